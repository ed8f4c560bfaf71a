// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "geometry/volume.h"

namespace bocst::query {

/// True if two spheres of cells touch, in one frame. Conservative answers follow from this alone.
inline bool spheresMeet(const Sphere& a, const Sphere& b, double tolerance) {
  const double extent = (a.radius + b.radius) * (1 + 1e-12) + tolerance;
  return (a.center - b.center).squaredNorm() <= extent * extent;
}

/// A leaf that is a cell, as the visitor sees it: its sphere in the frame of side A.
struct CellLeaf {
  std::uint64_t id;
  Sphere sphere;
};

/// Limits of a walk that wants only the first pairs in their order; the visitor lowers them as it finds pairs. With
/// exact answers, nodes are left out if their least coordinate along `direction` is larger than `last`: those of side
/// A, and of side B where it has triangles. Where leaves are cells, nodes are left out if all their cells have ids
/// larger than `last_cell`.
struct Cut {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitX();   ///< Frame of A; no entry is negative, none more than 1.
  double last = std::numeric_limits<double>::infinity();  ///< Along direction, in lattice units.
  int cell_side = 0;                                      ///< Whose ids count if both sides have cells; 0: A, 1: B.
  std::uint64_t last_cell = ~std::uint64_t{0};

  double leastOf(const Volume& v) const {
    double least = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      least += direction[static_cast<int>(k)] * (v.center[k] - static_cast<double>(v.half[k]));
    }
    return least;
  }
  double leastOf(const OrientedVolume& v) const {
    return direction.dot(v.center) - (direction.transpose() * v.axes).cwiseAbs().dot(v.half);
  }
  /// The same of a node of side B, in the frame of A.
  double leastOf(const Volume& v, const SimilarityTransform& to_a) const { return leastOf(oriented(v), to_a); }
  double leastOf(const OrientedVolume& v, const SimilarityTransform& to_a) const {
    const Eigen::RowVector3d row = to_a.scale * direction.transpose() * to_a.rotation;
    return row.dot(v.center) + direction.dot(to_a.translation) - (row * v.axes).cwiseAbs().dot(v.half);
  }
  /// The largest coordinate, of a node of side B.
  double greatestOf(const Volume& v, const SimilarityTransform& to_a) const { return greatestOf(oriented(v), to_a); }
  double greatestOf(const OrientedVolume& v, const SimilarityTransform& to_a) const {
    const Eigen::RowVector3d row = to_a.scale * direction.transpose() * to_a.rotation;
    return row.dot(v.center) + direction.dot(to_a.translation) + (row * v.axes).cwiseAbs().dot(v.half);
  }
  /// How far a box with these least coordinates may reach along axis k before all of its points are beyond the cut.
  double reach(const Eigen::Vector3d& least, int k) const {
    const double left = std::max(most() - direction.dot(least), 0.0);
    return direction[k] > 0 ? left / direction[k] : std::numeric_limits<double>::infinity();
  }
  /// Half extents are rounded to float: by less than 2^-8 of a lattice unit, as is the middle.
  double most() const { return last + 0x1p-5; }
  bool isBeyond(double least) const { return least > most(); }
};

/// A walk that goes on until all is visited.
constexpr std::size_t kNoLimit = ~std::size_t{0};

/// How a walk ended that has a limit.
struct WalkEnd {
  bool met;  ///< The visitor ended it.
  std::size_t steps;
  bool gave_up;  ///< At the limit.
};

/// What a query does with the pairs that a walk finds. Each function returns true to end the walk. A pair may come more
/// than once.
class Visitor {
 public:
  virtual ~Visitor() = default;

  /// The first hit will end the walk.
  virtual bool endsAtFirst() const = 0;
  /// Null where all are to be visited. The walk looks at it again whenever it has called the visitor.
  virtual const Cut* cut() const { return nullptr; }
  /// Triangle a of side A and b of side B may touch; everything that touches comes here. Where `certain`, they meet,
  /// and FCL's test says so.
  virtual bool triangles(std::uint32_t a, std::uint32_t b, bool certain) = 0;
  /// Called by a walk in order when it has reported all pairs of triangles of two leaves.
  virtual bool endLeaves() { return false; }
  /// The spheres of two cells overlap.
  virtual bool cells(const CellLeaf& a, const CellLeaf& b) = 0;
  /// A cell's sphere on one side meets a triangle on the other, whose point nearest to the sphere's centre is `point`
  /// (frame of A).
  virtual bool cellOfA(const CellLeaf& a, std::uint32_t b, const Eigen::Vector3d& point) = 0;
  virtual bool cellOfB(std::uint32_t a, const CellLeaf& b, const Eigen::Vector3d& point) = 0;
};

/// The same where side B is made of solid bodies; `b` is the node of one.
template <typename Node>
class ConvexVisitor {
 public:
  virtual ~ConvexVisitor() = default;

  virtual bool endsAtFirst() const = 0;
  virtual const Cut* cut() const { return nullptr; }
  /// Triangle a of side A and body b may touch; everything that touches comes here.
  virtual bool triangle(std::uint32_t a, const Node& b) = 0;
  /// All triangles of a leaf have come that are near a body, of a walk in order.
  virtual bool endLeaves() { return false; }
  /// The sphere of a cell (frame of A) meets body b.
  virtual bool cell(const CellLeaf& a, const Node& b) = 0;
};

/// What a walk calls whose side B is of this class.
template <typename B>
using VisitorOf = std::conditional_t<B::kBodies, ConvexVisitor<typename B::Node>, Visitor>;

}  // namespace bocst::query
