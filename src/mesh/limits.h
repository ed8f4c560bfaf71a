// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst {

/// Meshes have no larger coordinates: their squares and cubes appear in the exact test and must stay finite.
constexpr double kMostCoordinate = 1e75;

}  // namespace bocst
