// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <exception>
#include <functional>
#include <limits>

#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/pair/ordered_pair.h"
#include "query/cull/far_apart.h"
#include "query/cull/separation.h"
#include "query/sides/side.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// Calls f, the work of a tree at the end of a query. If f lacks memory or room, a later query does the work; the
/// answer stands.
template <typename F>
void tryAtEnd(F&& f) {
  try {
    f();
  } catch (const std::exception&) {
  }
}
inline void endQuery(const query::TreeSide& side) {
  tryAtEnd([&] { side.tree().afterQuery(side.now()); });
}

static_assert(kSurelyRigidError <= 2e-5, "what query::areFarApart() allows for");

/// True if two models are surely farther apart than `margin`, so that nothing need be locked; else `hulls` has what is
/// known of their hulls. For poses that are surely rigid. False where branches are due to be dropped, since only a
/// query that holds the locks drops them, at its end.
template <typename S>
bool areFarApart(const tree::Tree& a, const fcl::Transform3<S>& X_WA, const tree::Tree& b,
                 const fcl::Transform3<S>& X_WB, double margin, query::Hulls& hulls) {
  const S *x = X_WA.matrix().data(), *y = X_WB.matrix().data();
  if (!query::areFarApart(a.outline(), x, b.outline(), y, margin)) {
    // Supports know nothing of spheres.
    if (a.conservative() || b.conservative()) return false;
    hulls = query::hullsWithoutLock<S>({a.supports(), a.outline()}, x, {b.supports(), b.outline()}, y, margin);
    if (hulls != query::Hulls::kApart) return false;
  }
  if (!a.hasDecay() && !b.hasDecay()) return true;
  // The system's clock need not be read twice.
  const std::int64_t now_a = a.now(), now_b = a.options().clock || b.options().clock ? b.now() : now_a;
  return !(a.hasDecay() && a.isPruneDue(now_a)) && !(b.hasDecay() && b.isPruneDue(now_b));
}

/// The same for a model and a BVHModel, and for any poses.
template <typename S>
bool areFarApart(const tree::Tree& a, const fcl::Transform3<S>& X_WA, const BvhSide& b, const fcl::Transform3<S>& X_WB,
                 double margin) {
  return areSurelyRigid(X_WA, X_WB) &&
         query::areFarApart(a.outline(), X_WA.matrix().data(), b.outline(), X_WB.matrix().data(), margin) &&
         !(a.hasDecay() && a.isPruneDue(a.now()));
}

/// The session of one query about one or two trees. While it lives, it holds their query locks shared, so nobody
/// removes nodes; when it ends, also by an exception, it gives the locks back and calls Tree::afterQuery() of both.
class QueryScope {
 public:
  explicit QueryScope(tree::Tree& a) : locks_(a, a), a_(a), b_(a_) {
    recallMeshes();
    a.buildIfDue();
  }
  QueryScope(tree::Tree& a, tree::Tree& b)
      : locks_(a, b),
        a_(a),
        // The system's clock need not be read twice.
        b_(b, a.options().clock || b.options().clock ? b.now() : a_.now()) {
    recallMeshes();
    if (!a.buildIfDue()) b.buildIfDue();  // one a query, as each may take milliseconds
  }
  ~QueryScope() {
    tryAtEnd([&] { a_.tree().packNoted(); });
    tryAtEnd([&] { b_.tree().packNoted(); });
    locks_.release();
    endQuery(a_);
    if (&b_.tree() != &a_.tree()) endQuery(b_);
  }
  QueryScope(const QueryScope&) = delete;
  QueryScope& operator=(const QueryScope&) = delete;

  const query::TreeSide& a() const { return a_; }
  const query::TreeSide& b() const { return b_; }  ///< a() where there is one tree.

 private:
  /// The query locks of two trees, or of one that is given twice, taken shared in address order.
  class ReadLocks {
   public:
    ReadLocks(tree::Tree& a, tree::Tree& b)
        : first_(std::min(&a, &b, std::less<tree::Tree*>())),
          second_(&a != &b ? std::max(&a, &b, std::less<tree::Tree*>()) : nullptr),
          shard_(thread::ShardedLock::shard()) {
      take();
    }
    ~ReadLocks() { release(); }
    ReadLocks(const ReadLocks&) = delete;
    ReadLocks& operator=(const ReadLocks&) = delete;

    void take() {
      first_->queryLock().lock_shared(shard_);
      held_ = 1;
      if (second_ == nullptr) return;
      try {
        second_->queryLock().lock_shared(shard_);
      } catch (...) {
        release();
        throw;
      }
      held_ = 2;
    }
    void release() {
      if (held_ == 2) second_->queryLock().unlock_shared(shard_);
      if (held_ != 0) first_->queryLock().unlock_shared(shard_);
      held_ = 0;
    }

   private:
    tree::Tree *const first_, *const second_;
    const std::size_t shard_;
    int held_ = 0;
  };

  // Brings released meshes back that exact answers need; the locks are free meanwhile.
  void recallMeshes() {
    while (a_.tree().lacksMesh() || b_.tree().lacksMesh()) {
      locks_.release();
      a_.tree().recallMesh();
      b_.tree().recallMesh();
      locks_.take();
    }
  }

  ReadLocks locks_;
  query::TreeSide a_, b_;
};

inline double magnitudeOf(const query::TreeSide& side) { return magnitudeOf(side.tree().surface().bounds); }
inline double unitOf(const query::TreeSide& side) { return side.tree().surface().lattice.unit(); }
inline const Eigen::Vector3d& originOf(const query::TreeSide& side) { return side.tree().surface().lattice.origin(); }

/// The middle of a surface and its largest half extent, in the frame of the side's nodes.
struct Extent {
  Eigen::Vector3d middle;
  double half;
};
inline Extent extentOf(const query::TreeSide& side) {
  const Eigen::AlignedBox3d& bounds = side.tree().surface().bounds;
  return {(bounds.center() - originOf(side)) / unitOf(side), bounds.sizes().maxCoeff() / 2 / unitOf(side)};
}
inline Extent extentOf(const BvhSide& side) {
  const query::Sphere root = side.sphere(side.root());
  return {root.center, root.radius};
}

inline double magnitudeOf(const BvhSide& side) { return side.magnitude(); }
inline double unitOf(const BvhSide&) { return 1; }
inline Eigen::Vector3d originOf(const BvhSide& side) { return side.origin(); }

/// Where side B is in the frame of side A.
struct RelativeSides {
  query::SimilarityTransform b_in_a;
  double magnitude;  ///< Positions in the frame of either are at most this large, in model units.
};

/// FCL takes the transposed rotation of o1 for its inverse. Where an orthogonality error makes the two differ, the walk
/// of a swapped pair inverts FCL's pose of o2 in the frame of o1. Positions are then off by this error times the
/// distance and the sizes of the surfaces, and not times their distance from the origins of their models.
template <typename S, typename B>
RelativeSides relate(const OrderedPair<S>& pair, const query::TreeSide& a, const B& b) {
  const auto place = [&](const RelativePose<S>& X_AB) {
    const double magnitude = X_AB.magnitude(magnitudeOf(a), magnitudeOf(b));
    return RelativeSides{similarityOf(X_AB, originOf(a), unitOf(a), originOf(b), unitOf(b), magnitude), magnitude};
  };
  RelativeSides sides = place({pair.X_WA(), pair.X_WB()});
  query::SimilarityTransform& b_in_a = sides.b_in_a;
  double lengths = sides.magnitude / unitOf(a);
  // Below, FCL's own rounding is more.
  if (b_in_a.orthogonality_error > 16 * static_cast<double>(std::numeric_limits<S>::epsilon())) {
    if (pair.swapped) sides = place(RelativePose<S>(pair.X_W1, pair.X_W2).inverse());
    const Extent of_a = extentOf(a), of_b = extentOf(b);
    lengths =
        std::min(lengths, (b_in_a * of_b.middle - of_a.middle).norm() + 2 * (of_a.half + of_b.half * b_in_a.scale));
  }
  b_in_a.tolerance += 4 * b_in_a.orthogonality_error * lengths;
  return sides;
}

}  // namespace bocst::fcl_adapter
