// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "query/sides/side.h"

namespace bocst::query {

/// The walk of queries that look for the least of something (a distance, a time) over all pairs of leaves. Best first:
/// pairs of nodes lie in a heap by a lower bound, and what cannot beat the best answer is never looked at. Pairs that
/// need a node that is not expanded wait, the nearest first, while what is resident may still make them superfluous;
/// then they grow in one batch, each twice as large as the one before.
///
/// A query (Walk) derives from this and has, for this base: worthIt(bound); settled(); tie(), by how much bounds may
/// differ without a difference to the answer: of such pairs, the last is taken first; again(pair), true when it pushed
/// the pair with a better bound instead; extentOfA(node) and extentOfB(node), or sphereOfA(node) and sphereOfB(node)
/// when a side answers with cells; boundOf() of two of these; leaves(pair); scaleOfB(), the unit of B in that of A.
template <typename Walk, typename A, typename B>
class BestFirst {
 public:
  /// True if the walk ended after its most steps, before it was sure.
  bool gaveUp() const { return steps_ > most_steps_; }
  std::size_t steps() const { return steps_; }

 protected:
  struct Pair {
    double bound;
    typename A::Node a;
    typename B::Node b;
  };
  /// Kept by the thread between walks.
  struct Heap {
    std::vector<Pair> heap, waiting;
    std::vector<tree::Tree::Growth> growths;
  };

  BestFirst(const A& a, const B& b, Heap& heap) : a_(a), b_(b), heap_(heap) {}

  void limitSteps(std::size_t most) {
    steps_ = 0;
    most_steps_ = most;
  }
  void countSteps(std::size_t count = 1) { steps_ += count; }

  /// Looks at pairs, from that of the roots on, until nothing can be better than what was found.
  void search() {
    heap_.heap.clear();
    heap_.waiting.clear();
    has_next_ = false;
    const Pair root{0, a_.root(), b_.root()};
    push({boundOf(root), root.a, root.b});
    std::size_t batch = kFirstBatch;
    for (;;) {
      while (heap_.waiting.size() < batch && next()) {
        const Pair pair = next_;
        has_next_ = false;
        step(pair);
        if (walk().settled()) return;
      }
      const auto end = std::remove_if(heap_.waiting.begin(), heap_.waiting.end(),
                                      [this](const Pair& p) { return !walk().worthIt(p.bound); });
      heap_.waiting.erase(end, heap_.waiting.end());
      if (heap_.waiting.empty()) {
        if (!next()) return;
        continue;
      }
      grow();
      batch *= 2;
    }
  }

  /// Puts a pair on the heap, if it is worth it.
  void push(const Pair& pair) {
    if (walk().worthIt(pair.bound)) put(pair);
  }

  double boundOf(const Pair& pair) {
    return spheres() ? walk().boundOf(walk().sphereOfA(pair.a), walk().sphereOfB(pair.b))
                     : walk().boundOf(walk().extentOfA(pair.a), walk().extentOfB(pair.b));
  }

  /// Pushes the pairs of one node's children and the other node. A query may have a faster way of its own.
  void expand(const Pair& pair, bool expands_a) {
    if (expands_a) {
      expandA(pair);
    } else {
      expandB(pair);
    }
  }

  /// Which node of a pair that is not two leaves is expanded, given their states: the larger that can be.
  bool expandsA(const Pair& pair, State sa, State sb) const {
    const double scale = walk().scaleOfB();
    return sb == State::kLeaf || (sa != State::kLeaf && a_.size(pair.a) >= b_.size(pair.b) * scale * scale);
  }

  bool spheres() const { return a_.isConservative() || b_.isConservative(); }

  const A& a_;
  const B& b_;

 private:
  static constexpr std::size_t kFirstBatch = 4;

  Walk& walk() { return static_cast<Walk&>(*this); }
  const Walk& walk() const { return static_cast<const Walk&>(*this); }
  struct Later {
    bool operator()(const Pair& x, const Pair& y) const { return x.bound > y.bound; }
  };

  // The pair of the least bound since the last call of next() stays out of the heap: usually it is taken next.
  void put(Pair pair) {
    if (!has_next_) {
      next_ = pair;
      has_next_ = true;
      return;
    }
    if (pair.bound < next_.bound) std::swap(pair, next_);
    heap_.heap.push_back(pair);
    std::push_heap(heap_.heap.begin(), heap_.heap.end(), Later());
  }

  // Makes the pair of the least bound the next; false when it is not worth it, or there is none.
  bool next() {
    if (!heap_.heap.empty() &&
        (!has_next_ || heap_.heap.front().bound < next_.bound - walk().tie() || !walk().worthIt(next_.bound))) {
      std::pop_heap(heap_.heap.begin(), heap_.heap.end(), Later());
      Pair least = heap_.heap.back();
      heap_.heap.pop_back();
      if (has_next_) {
        heap_.heap.push_back(next_);
        std::push_heap(heap_.heap.begin(), heap_.heap.end(), Later());
      }
      next_ = least;
      has_next_ = true;
    }
    return has_next_ && walk().worthIt(next_.bound);
  }

  void step(const Pair& pair) {
    if (walk().again(pair)) return;
    const State sa = a_.state(pair.a), sb = b_.state(pair.b);
    if (sa == State::kLeaf && sb == State::kLeaf) {
      walk().leaves(pair);
      return;
    }
    const bool expands_a = expandsA(pair, sa, sb);
    if ((expands_a ? sa : sb) == State::kGrows) {
      heap_.waiting.push_back(pair);
    } else {
      walk().expand(pair, expands_a);
    }
  }

  void expandA(const Pair& pair) {
    if (spheres()) {
      const auto b = walk().sphereOfB(pair.b);
      a_.children(pair.a, [&](typename A::Node c) { push({walk().boundOf(walk().sphereOfA(c), b), c, pair.b}); });
    } else {
      const auto b = walk().extentOfB(pair.b);
      a_.children(pair.a, [&](typename A::Node c) { push({walk().boundOf(walk().extentOfA(c), b), c, pair.b}); });
    }
  }

  void expandB(const Pair& pair) {
    if (spheres()) {
      const auto a = walk().sphereOfA(pair.a);
      b_.children(pair.b, [&](typename B::Node c) { push({walk().boundOf(a, walk().sphereOfB(c)), pair.a, c}); });
    } else {
      const auto a = walk().extentOfA(pair.a);
      b_.children(pair.b, [&](typename B::Node c) { push({walk().boundOf(a, walk().extentOfB(c)), pair.a, c}); });
    }
  }

  void grow() {
    heap_.growths.clear();
    for (const Pair& p : heap_.waiting) {
      if (a_.state(p.a) == State::kGrows) a_.grow(p.a, heap_.growths);
      if (b_.state(p.b) == State::kGrows) b_.grow(p.b, heap_.growths);
    }
    tree::Tree::grow(heap_.growths);
    for (const Pair& p : heap_.waiting) put(p);
    heap_.waiting.clear();
  }

  Heap& heap_;
  std::size_t steps_ = 0, most_steps_ = 0;
  Pair next_{};
  bool has_next_ = false;
};

}  // namespace bocst::query
