// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "query/sides/box_side.h"

namespace bocst::query {

/// How long a walk over the blocks of one model or two and one over their oriented boxes (BoxSide) take turns, until
/// one ends. The first is usually quicker; but between two flat faces with little space between them, or of slivers,
/// its volumes separate little. Each turn may take longer than the one before, so all take at most some times what the
/// quicker way takes. The limits follow how the last long search of each tree ended: if over blocks, they get twice as
/// many steps at once; if over boxes, the blocks get only as much time before them as the boxes took. A step takes
/// about as long as a test of two leaves; walks count what takes longer as several.
///
/// The boxes are built when walks have paid for them, as whole trees are.
class Turns {
 public:
  struct Limits {
    std::size_t few;         ///< Steps over blocks in the first turn, once the boxes are built ...
    std::size_t many;        ///< ... and before. Longer walks over blocks pay for the boxes.
    std::size_t over_boxes;  ///< The least number of steps over boxes.
    std::size_t per_box;     ///< A step over boxes takes as long as this many over blocks.
  };
  /// Walks for contacts go on after a hit.
  struct LimitsByKind {
    Limits of_verdict, of_contacts;
  };

  template <typename B>
  Turns(const TreeSide& a, const B& b, tree::Tree::Search kind, const Limits& limits)
      : trees_{&a.tree(), treeOf(b)}, kind_(kind), limits_(limits) {
    const tree::Tree& second = trees_[1] != nullptr ? *trees_[1] : *trees_[0];
    const std::size_t price = trees_[0]->boxPrice() + (trees_[1] != nullptr ? second.boxPrice() : 0);
    const tree::Tree::LongSearch last[2] = {trees_[0]->longSearch(kind), second.longSearch(kind)};
    most_ = price == 0 ? limits.few : std::max(limits.many, price);
    if (last[0].over_boxes != last[1].over_boxes) return;
    const std::size_t steps = std::min(last[0].steps, last[1].steps);
    last_over_boxes_ = last[0].over_boxes != 0;
    times_ = std::min(last[0].times, last[1].times);
    // What would have ended soon after it was given up must not be given up for ever: the 2nd, 4th, 8th, ... time the
    // other way gets longer.
    const bool tries_other = times_ > 1 && (times_ & (times_ - 1)) == 0;
    if (last_over_boxes_) {
      most_over_boxes_ = 2 * steps;
      if (price == 0) most_ = limits.per_box * steps * (tries_other ? 2 : 1);
    } else if (price == 0 && steps > 0) {
      most_ = std::max(most_, tries_other ? steps / 4 : 2 * steps);
      follows_blocks_ = true;
    }
  }

  /// True if boxes are built, or queries have paid for them.
  template <typename B>
  static bool arePaid(const TreeSide& a, const B& b) {
    const tree::Tree* const second = treeOf(b);
    return a.tree().boxPrice() == 0 && (second == nullptr || second->boxPrice() == 0);
  }

  /// A walk that took no turns took so many steps, where one over boxes might have been quicker.
  template <typename B>
  static void pay(const TreeSide& a, const B& b, const Limits& limits, std::size_t steps) {
    if (steps <= limits.many) return;
    a.tree().payBoxRent(steps - limits.many);
    if (const tree::Tree* const second = treeOf(b)) second->payBoxRent(steps - limits.many);
  }

  /// Of this turn.
  std::size_t most() const { return most_; }
  std::size_t mostOverBoxes() const {
    return std::max({limits_.over_boxes, most_ / limits_.per_box, most_over_boxes_});
  }

  /// The walk over blocks took so many steps, and gave up or not.
  void tookOverBlocks(std::size_t steps, bool gave_up) const {
    for (const tree::Tree* tree : trees_) {
      if (tree != nullptr && steps > limits_.many) tree->payBoxRent(steps - limits_.many);
    }
    // In a first turn, boxes were not tried; and a short walk says nothing.
    if (!gave_up && steps > limits_.few && (!is_first_ || follows_blocks_)) remember(false, steps);
  }
  /// The walk over boxes ended.
  void endedOverBoxes(std::size_t steps) const { remember(true, steps); }

  void next() {
    constexpr std::size_t kLonger = 16;
    most_ = kLonger * std::max(most_, limits_.few);
    is_first_ = false;
  }

 private:
  void remember(bool over_boxes, std::size_t steps) const {
    constexpr std::size_t kMost = std::size_t{1} << 30;
    constexpr std::uint32_t kMostTimes = 1u << 30;
    const std::uint32_t times = over_boxes == last_over_boxes_ ? std::min(times_ + 1, kMostTimes) : 1;
    for (const tree::Tree* tree : trees_) {
      if (tree == nullptr) continue;
      tree->setLongSearch(kind_, {over_boxes, times, static_cast<std::uint32_t>(std::min(steps, kMost))});
    }
  }

  const tree::Tree* trees_[2];  // the second may be null
  const tree::Tree::Search kind_;
  const Limits limits_;
  std::size_t most_ = 0, most_over_boxes_ = 0;
  bool last_over_boxes_ = false, follows_blocks_ = false, is_first_ = true;
  std::uint32_t times_ = 0;  // in a row; 0 if the two trees do not agree
};

}  // namespace bocst::query
