// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cli/arguments.h"
#include "picture/grown_pair.h"
#include "picture/picture.h"
#include "render/renderer.h"

namespace bocst::program {

/// The objects with their contacts, what grew in both, and the place where they touch, or all but touch, near by. Seen
/// from where most of that place is seen.
Picture pairPicture(render::Renderer& renderer, const GrownPair& grown, const ImageArguments& image);

}  // namespace bocst::program
