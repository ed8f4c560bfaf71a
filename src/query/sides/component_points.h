// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "geometry/volume.h"
#include "query/sides/side.h"
#include "thread/of_thread.h"

namespace bocst::query {

/// Yields points of side B's bodies, none of which may meet the surface of side A. Then each body is on one side of
/// that surface, and one point for each connected component of the bodies tells on which. If the surface of A does not
/// meet a node of B, all bodies below the node are on one side, and one point stands for them.
template <typename A, typename B>
class ComponentPoints {
 public:
  /// Touching within b_in_a.tolerance counts as meeting. Nothing is grown: where side A is not known well, more points
  /// come.
  ComponentPoints(const A& a, const B& b, const SimilarityTransform& b_in_a)
      : a_(a), b_(b), b_in_a_(b_in_a), near_(scratch()) {
    near_.clear();
    near_.push_back(a.root());
  }

  /// Calls f with points (frame of B) until it returns true, and says whether it did.
  template <typename F>
  bool any(F&& f) {
    return any(b_.root(), 0, 1, f);
  }

 private:
  using NodeA = typename A::Node;
  using NodeB = typename B::Node;

  static std::vector<NodeA>& scratch() {
    struct Near {
      std::vector<NodeA> nodes;
    };
    return thread::ofThread<Near>().nodes;
  }

  // The nodes of A in near_ from `begin` to `end` hold all of the surface that may meet this node's parent.
  template <typename F>
  bool any(const NodeB& node, std::size_t begin, std::size_t end, F& f) {
    if (b_.state(node) == State::kLeaf) return take(node, f);
    const OrientedVolume box = oriented(b_.volume(node));
    const double size = b_.size(node) * b_in_a_.scale * b_in_a_.scale;
    for (std::size_t i = begin; i < end; ++i) addNear(NodeA(near_[i]), box, size);
    const std::size_t last = near_.size();
    bool found = false;
    if (last == end) {
      found = takeOne(node, f).value_or(false);
    } else {
      b_.children(node, [&](const NodeB& child) { found = found || any(child, end, last, f); });
    }
    near_.resize(end);
    return found;
  }

  // Parts of A that are larger than the box, and known, are looked at more closely.
  void addNear(const NodeA& a, const OrientedVolume& box, double size) {
    if (boxesApart(oriented(a_.volume(a)), box, b_in_a_)) return;
    if (a_.state(a) == State::kInner && a_.size(a) > size) {
      a_.children(a, [&](const NodeA& child) { addNear(child, box, size); });
    } else {
      near_.push_back(a);
    }
  }

  template <typename F>
  bool take(const NodeB& leaf, F& f) const {
    const std::optional<Eigen::Vector3d> point = b_.point(leaf);
    return point && f(*point);
  }

  // What f says of the first body below a node, if there is one.
  template <typename F>
  std::optional<bool> takeOne(const NodeB& node, F& f) const {
    if (b_.state(node) == State::kLeaf) return take(node, f);
    std::optional<bool> said;
    b_.children(node, [&](const NodeB& child) {
      if (!said) said = takeOne(child, f);
    });
    return said;
  }

  const A& a_;
  const B& b_;
  const SimilarityTransform& b_in_a_;
  std::vector<NodeA>& near_;
};

}  // namespace bocst::query
