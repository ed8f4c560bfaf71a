// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/support_refinement.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "geometry/extent.h"

namespace bocst::query {
namespace {

using tree::SupportTable;

// What a miss may spend on each side for later misses, in triangles that are projected. Growing a node from the root
// grid counts as kGrowthEffort of them.
constexpr std::size_t kEffort = 1 << 13, kGrowthEffort = 1 << 10;

// A part of the surface and how far it may reach.
struct Part {
  double extent;
  tree::NodeRef node;
  bool known = false;  // the tree can say no more
  bool operator<(const Part& other) const { return extent < other.extent; }
};

// Asks one tree how far its surface reaches, after a miss.
class SupportRefinement {
 public:
  explicit SupportRefinement(const TreeSide& side) : side_(side), scratch_(scratch()) {}

  /// Of a kept direction; false when that takes more effort than is left, and a later miss can do better: with all of
  /// the effort, or with the nodes that were grown now.
  bool ask(int number) {
    tree::SupportTable& supports = side_.tree().supports();
    direction_ = SupportTable::direction(number);
    has_all_effort_ = left_ == kEffort;
    grew_ = false;
    scratch_.parts.clear();
    addNode(side_.root());
    while (!scratch_.parts.empty()) {
      std::pop_heap(scratch_.parts.begin(), scratch_.parts.end());
      const Part part = scratch_.parts.back();
      scratch_.parts.pop_back();
      if (part.known) {
        supports.lower(number, part.extent);
        return true;
      }
      if (growsFromGrid(part.node) && !grow(part.node)) {
        // No part extends farther. A direction that can't be known better must not be asked about for ever.
        if (has_all_effort_ && !grew_ && left_ < kGrowthEffort) supports.lower(number, part.extent);
        return false;
      }
      if (side_.state(part.node) == State::kInner) {
        side_.children(part.node, [this](tree::NodeRef node) { addNode(node); });
      } else if (!addTriangles(part)) {
        return false;
      }
    }
    // A sampled oracle has lost all of the surface.
    supports.lower(number, supports.value(number));
    return true;
  }

 private:
  // Kept by the thread.
  struct Scratch {
    std::vector<Part> parts;  // a heap
    std::vector<std::uint32_t> triangles;
    std::vector<tree::Tree::Growth> growth;
  };
  static Scratch& scratch() {
    thread_local Scratch scratch;
    return scratch;
  }

  void add(const Part& part) {
    scratch_.parts.push_back(part);
    std::push_heap(scratch_.parts.begin(), scratch_.parts.end());
  }

  void addNode(tree::NodeRef node) {
    const NodeExtent extent(side_.volume(node), SimilarityTransform());
    double lo, hi;
    extent.along(direction_, lo, hi);
    add({hi + direction_.dot(extent.center - middle_), node});
  }

  // The part as its triangles know it, or, if it cannot be otherwise, its bounds.
  bool addTriangles(const Part& part) {
    const bool are_known =
        side_.tree().trianglesOf(part.node, left_, scratch_.triangles) && !scratch_.triangles.empty();
    left_ -= std::min(left_, scratch_.triangles.size());
    side_.tree().payRent(scratch_.triangles.size());
    if (!are_known) {
      // Perhaps they only are too many for what is left now.
      const bool are_too_many = has_all_effort_ && hasTriangles(part.node);
      if (are_too_many) add({part.extent, part.node, true});
      return are_too_many;
    }
    double extent = -std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : scratch_.triangles) {
      for (int k = 0; k < 3; ++k) extent = std::max(extent, direction_.dot(side_.corner(t, k) - middle_));
    }
    add({extent, part.node, true});
    return true;
  }

  // Does the host know which triangles they are?
  bool hasTriangles(tree::NodeRef node) const {
    const tree::ChildRef ref = side_.tree().childRef(node);
    return ref.isList() ? side_.tree().list(ref).ids.areKnown() : !node.isRoot() && !growsFromGrid(node);
  }

  bool growsFromGrid(tree::NodeRef node) const {
    return side_.state(node) == State::kGrows && side_.growsFromGrid(node) && side_.tree().hasBudget();
  }

  // Unless another thread grows the tree just now.
  bool grow(tree::NodeRef node) {
    if (left_ < kGrowthEffort) return false;
    left_ -= kGrowthEffort;
    grew_ = true;
    scratch_.growth.clear();
    side_.grow(node, scratch_.growth);
    tree::Tree::grow(scratch_.growth, false);
    return side_.state(node) == State::kInner;
  }

  const TreeSide& side_;
  Scratch& scratch_;
  const Eigen::Vector3d middle_ = Eigen::Vector3d::Constant(lattice::kMiddle);
  Eigen::Vector3d direction_;
  std::size_t left_ = kEffort;
  bool has_all_effort_ = true;  // for the direction that is asked about
  bool grew_ = false;           // for it
};

void sharpen(const TreeSide& side, const std::int32_t (&near)[3][8]) {
  tree::SupportTable& supports = side.tree().supports();
  SupportRefinement sharpening(side);
  for (int lane = 0; lane < 8; ++lane) {
    // The last look is at directions so close to each other that most are between the same.
    if (lane > 0 && near[0][lane] == near[0][lane - 1] && near[1][lane] == near[1][lane - 1]) continue;
    for (int k = 0; k < 3; ++k) {
      if (supports.isOpen(near[k][lane]) && !sharpening.ask(near[k][lane])) return;
    }
  }
}

}  // namespace

void refineSupports(const TreeSide& a, const TreeSide& b, const NearDirections& near) {
  if (near.lanes == 0) return;
  sharpen(a, near.of_a);
  sharpen(b, near.of_b);
}

}  // namespace bocst::query
