// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>
#include <fcl/geometry/collision_geometry.h>

#include <utility>

namespace bocst::fcl_adapter {

/// The two geometries of a query in the caller's order, and which of them is side A of the walk. A Place says where a
/// geometry is: its pose in the world, or its motion.
template <typename S, typename Place = fcl::Transform3<S>>
struct OrderedPair {
  const fcl::CollisionGeometry<S>* o1;
  const Place& X_W1;
  const fcl::CollisionGeometry<S>* o2;
  const Place& X_W2;
  bool swapped;  ///< Side A of the walk is o2.

  const fcl::CollisionGeometry<S>* a() const { return swapped ? o2 : o1; }
  const fcl::CollisionGeometry<S>* b() const { return swapped ? o1 : o2; }
  const Place& X_WA() const { return swapped ? X_W2 : X_W1; }
  const Place& X_WB() const { return swapped ? X_W1 : X_W2; }

  /// Turns what is known of side A and side B into what is known of o1 and o2; or back.
  template <typename T>
  void inCallersOrder(T& of_a, T& of_b) const {
    if (swapped) std::swap(of_a, of_b);
  }
};

}  // namespace bocst::fcl_adapter
