// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>

#include <string>
#include <vector>

#include "cli/arguments.h"
#include "mesh/health.h"
#include "picture/picture.h"
#include "render/renderer.h"

namespace bocst::program {

/// How it looks at a tree with this root.
render::View viewOf(const NodeView& root, render::Up up);

/// The mesh, then the tree of it as it ends at each level, all from one side and at one scale.
/// @param nodes the whole tree down to the level options.depth, the root first.
Picture inspectPicture(render::Renderer& renderer, const std::string& file, const Mesh& mesh,
                       const std::vector<NodeView>& nodes, const Faults& faults, const Options& options,
                       const ImageArguments& image);

}  // namespace bocst::program
