// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
#include <memory>

namespace bocst::program {

/// The same surface with at most this many triangles, or with the fewest that keep its topology, by edge collapse
/// (meshoptimizer). Vertices that stay are the mesh's own. The mesh itself if it has no more.
std::shared_ptr<const Mesh> decimated(const std::shared_ptr<const Mesh>& mesh, std::size_t triangles);

}  // namespace bocst::program
