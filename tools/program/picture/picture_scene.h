// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// What pictures of one mesh and of two have in common.

#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>

#include <array>
#include <string>
#include <vector>

#include "render/renderer.h"

namespace bocst::program {

/// From the right, the front and above.
constexpr double kTurn = 0.7, kTilt = 0.45;

/// A view's radius that is no less than what coordinates about this centre resolve.
double radiusToSee(double radius, const Eigen::Vector3d& center);

constexpr render::Color kMeshColor = {0.93f, 0.90f, 0.84f};

/// Of A and B.
constexpr std::array<render::Color, 2> kPairColors = {{{0.72f, 0.79f, 0.88f}, {0.91f, 0.80f, 0.67f}}};
constexpr std::array<render::Color, 2> kVolumeColors = {{{0.20f, 0.50f, 0.86f}, {0.93f, 0.52f, 0.16f}}};

render::Volumes volumesOf(const std::vector<NodeView>& nodes, const Mesh& mesh, const Options& options,
                          render::Volumes::Shape shape);

/// As the paper calls it.
std::string nameOf(Subdivision subdivision);

}  // namespace bocst::program
