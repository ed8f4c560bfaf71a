// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <memory>

#include "robot/parts.h"

namespace bocst::program {

/// All shapes of a part as one mesh, to be shown: round ones are prisms of many faces inside of them.
std::shared_ptr<const Mesh> meshOf(const Part& part);

}  // namespace bocst::program
