// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <new>

#include "fcl/adapters/pair.h"
#include "fcl/queries/ordered_pair.h"
#include "query/sides/side.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// Has a tree do what waits for the end of a query. Without memory for it, that waits for a later query; the answer
/// stands.
inline void endQuery(const query::TreeSide& side) {
  try {
    side.tree().afterQuery(side.now());
  } catch (const std::bad_alloc&) {
  }
}

/// The session of one query about one or two trees. While it lives, it holds their query locks shared, so nobody
/// removes nodes; when it ends, also by an exception, it gives the locks back and calls Tree::afterQuery() of both.
class QueryScope {
 public:
  explicit QueryScope(tree::Tree& a) : locks_(a, a), a_(a), b_(a_) { a.buildIfDue(); }
  QueryScope(tree::Tree& a, tree::Tree& b)
      : locks_(a, b),
        a_(a),
        // The system's clock need not be read twice.
        b_(b, a.options().clock || b.options().clock ? b.now() : a_.now()) {
    if (!a.buildIfDue()) b.buildIfDue();  // one a query, as each may take milliseconds
  }
  ~QueryScope() {
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
    ReadLocks(tree::Tree& a, tree::Tree& b) : ReadLocks(std::less<tree::Tree*>()(&b, &a) ? b : a) {
      // Should this throw, the first is given back: its constructor has ended.
      tree::Tree* const last = first_ == &a ? &b : &a;
      if (last == first_) return;
      last->queryLock().lock_shared(shard_);
      second_ = last;
    }
    ~ReadLocks() { release(); }
    ReadLocks(const ReadLocks&) = delete;
    ReadLocks& operator=(const ReadLocks&) = delete;

    void release() {
      for (tree::Tree** tree : {&second_, &first_}) {
        if (*tree != nullptr) (*tree)->queryLock().unlock_shared(shard_);
        *tree = nullptr;
      }
    }

   private:
    explicit ReadLocks(tree::Tree& first) : first_(&first), shard_(thread::ShardedLock::shard()) {
      first_->queryLock().lock_shared(shard_);
    }

    tree::Tree* first_;
    tree::Tree* second_ = nullptr;
    std::size_t shard_;
  };

  ReadLocks locks_;
  query::TreeSide a_, b_;
};

inline double magnitudeOf(const query::TreeSide& side) { return magnitudeOf(side.tree().surface().bounds); }
inline double unitOf(const query::TreeSide& side) { return side.tree().surface().lattice.unit(); }
inline const Eigen::Vector3d& originOf(const query::TreeSide& side) { return side.tree().surface().lattice.origin(); }

inline double magnitudeOf(const BvhSide& side) { return side.magnitude(); }
inline double unitOf(const BvhSide&) { return 1; }
inline Eigen::Vector3d originOf(const BvhSide& side) { return side.origin(); }

/// Where side B is in the frame of side A.
struct RelativeSides {
  query::SimilarityTransform b_in_a;
  double magnitude;  ///< Positions in the frame of either are at most this large, in model units.
};

template <typename S, typename B>
RelativeSides relate(const OrderedPair<S>& pair, const query::TreeSide& a, const B& b) {
  const RelativePose<S> X_AB(pair.X_WA(), pair.X_WB());
  const double magnitude = X_AB.magnitude(magnitudeOf(a), magnitudeOf(b));
  return {similarityOf(X_AB, originOf(a), unitOf(a), originOf(b), unitOf(b), magnitude), magnitude};
}

}  // namespace bocst::fcl_adapter
