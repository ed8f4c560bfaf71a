// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "pairs/query_pair.h"

namespace bocst::program {

/// Poses of B in A's frame, one a frame: the smaller mesh slides over the larger one from outside, turning slowly. Both
/// go at most about a hundredth of the smaller mesh's radius a frame, once around the larger mesh where 2000 frames
/// reach that far. The path is smooth, so it now sinks in by some hundredths of that radius, now lifts off, most of all
/// behind what juts out.
/// @throws std::runtime_error when the meshes touch nowhere along it.
std::vector<Eigen::Isometry3d> slidingPath(const Mesh& a, const Mesh& b, const QueryPair& reference, std::uint64_t seed,
                                           std::size_t frames);

}  // namespace bocst::program
