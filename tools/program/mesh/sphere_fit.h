// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace bocst::program {

struct Sphere {
  Eigen::Vector3d center;
  double radius = 0;
};

/// Spheres about a surface, and how well they fit. Lengths are in the mesh's unit.
struct SphereFit {
  std::vector<Sphere> spheres;
  /// Greatest distance from a point on a sphere to the surface: a bound from above, as protrusionOf() finds it for each
  /// sphere and the triangles that it is about.
  double protrusion = 0;
  double average_protrusion = 0;  ///< Over the spheres, of each one's greatest.
  double coverage = 0;            ///< Of samples of the surface, the fraction that lies in a sphere.
};

/// Spheres that hold the whole surface: it is cut by planes, always the part that protrudes most, and each part has a
/// sphere about what is left of its triangles.
///
/// @param count the most spheres; 0: as many as the tolerance needs.
/// @param tolerance no cut of parts that protrude no more than this.
/// @throws std::runtime_error when more than kMostSpheres would be needed.
SphereFit fitSpheres(const Mesh& mesh, std::size_t count, double tolerance);

inline constexpr std::size_t kMostSpheres = 1000000;

}  // namespace bocst::program
