// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "query/sides/side.h"

namespace bocst::query {

/// The pairs of a walk that need a node that is not expanded, and the order in which they get it.
template <typename A, typename B>
class DeferredPairs {
 public:
  struct Pair {
    typename A::Node a;
    typename B::Node b;
    /// If one node is a leaf and the other is not: the triangles of the leaf that the other may meet, a bit each.
    std::uint32_t triangles = ~0u;
  };

  /// Pairs in the first batch of a walk that may end early; a few oracle answers cost less than one too many.
  static constexpr std::size_t kFirstBatch = 2;

  void clear() {
    waiting_.clear();
    batch_ = kFirstBatch;
  }
  bool empty() const { return waiting_.empty(); }
  /// True if there are as many as the next batch takes.
  bool fillsBatch() const { return waiting_.size() >= batch_; }
  void add(const Pair& pair) { waiting_.push_back({pair, kUnknown}); }

  /// Forgets the pairs of which f says that nobody asks for them any more.
  template <typename F>
  void dropIf(F&& f) {
    waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(), [&](const Waiting& w) { return f(w.pair); }),
                   waiting_.end());
  }

  /// Makes what some pairs need resident, in one batch, and gives these pairs to f. A walk that has to see everything
  /// grows all that is deferred, so it makes one batch a level. One that ends at its first hit takes the deepest
  /// overlaps first, and twice as many each time: a hit deep inside costs one small batch a level, a miss at most the
  /// logarithm of its pairs more.
  template <typename F>
  void grow(const A& a, const B& b, const SimilarityTransform& b_in_a, bool ends_at_first, F&& f) {
    const auto end = choose(a, b, b_in_a, ends_at_first);
    growths_.clear();
    for (auto w = end; w != waiting_.end(); ++w) add(a, b, w->pair, growths_);
    tree::Tree::grow(growths_);
    for (auto w = end; w != waiting_.end(); ++w) f(w->pair);
    waiting_.erase(end, waiting_.end());
  }

  /// Adds to `growths` what the next batch would make resident, of at most `batch` pairs that ask an oracle.
  void addGrowths(const A& a, const B& b, const SimilarityTransform& b_in_a, std::size_t batch,
                  std::vector<tree::Tree::Growth>& growths) {
    batch_ = batch;
    for (auto w = choose(a, b, b_in_a, true); w != waiting_.end(); ++w) add(a, b, w->pair, growths);
  }

 private:
  static constexpr double kUnknown = -1;

  struct Waiting {
    Pair pair;
    double gap;
  };

  // Puts the pairs of the next batch last; returns the first of them.
  typename std::vector<Waiting>::iterator choose(const A& a, const B& b, const SimilarityTransform& b_in_a,
                                                 bool ends_at_first) {
    // What root grids know grows first and alone: it needs no oracle.
    auto end = std::partition(waiting_.begin(), waiting_.end(),
                              [&](const Waiting& w) { return asks(a, w.pair.a) || asks(b, w.pair.b); });
    if (end == waiting_.end()) {
      if (ends_at_first && waiting_.size() > batch_) {
        end -= static_cast<std::ptrdiff_t>(batch_);
        for (Waiting& w : waiting_) {
          if (w.gap == kUnknown) w.gap = gap(sphereOf(a, w.pair.a), placed(sphereOf(b, w.pair.b), b_in_a));
        }
        std::nth_element(waiting_.begin(), end, waiting_.end(),
                         [](const Waiting& x, const Waiting& y) { return x.gap > y.gap; });
      } else {
        end = waiting_.begin();
      }
      batch_ *= 2;
    }
    return end;
  }

  // Both nodes where both must grow: the smaller one is expanded next.
  static void add(const A& a, const B& b, const Pair& pair, std::vector<tree::Tree::Growth>& growths) {
    if (a.state(pair.a) == State::kGrows) a.grow(pair.a, growths);
    if (b.state(pair.b) == State::kGrows) b.grow(pair.b, growths);
  }

  template <typename Side>
  static bool asks(const Side& side, typename Side::Node node) {
    return side.state(node) == State::kGrows && !side.growsFromGrid(node);
  }

  template <typename Side>
  static Sphere sphereOf(const Side& side, typename Side::Node node) {
    if constexpr (std::is_same<Side, TreeSide>::value) {
      return side.roughSphere(node);
    } else {
      return side.sphere(node);
    }
  }

  // The distance of the middles over the sizes, squared: least for the deepest overlap.
  static double gap(const Sphere& a, const Sphere& b) {
    return (a.center - b.center).squaredNorm() / (a.radius * a.radius + b.radius * b.radius);
  }

  std::vector<Waiting> waiting_;
  std::vector<tree::Tree::Growth> growths_;
  std::size_t batch_ = kFirstBatch;
};

}  // namespace bocst::query
