// SPDX-License-Identifier: BSD-3-Clause
#include "query/sharpening.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "query/reach.h"

namespace bocst::query {
namespace {

using tree::Supports;

// What a miss pays for later ones, on each side: so much as to look at some thousands of triangles. To grow a node by
// what the root grid knows is as much as a thousand.
constexpr std::size_t kEffort = 1 << 13, kGrowthEffort = 1 << 10;

// A part of the surface and how far it may reach.
struct Part {
  double reach;
  tree::NodeRef node;
  bool known = false;    // the tree can say no more
  bool reached = false;  // by a vertex
  bool operator<(const Part& other) const { return reach < other.reach; }
};

// Asks one tree how far its surface reaches, after a miss.
class Sharpening {
 public:
  explicit Sharpening(const TreeSide& side) : side_(side), room_(room()) {}

  /// Of a kept direction; false when that takes more effort than is left.
  bool ask(int number) {
    tree::Supports& supports = side_.tree().supports();
    direction_ = Supports::direction(number);
    has_all_effort_ = left_ == kEffort;
    room_.parts.clear();
    addNode(side_.root());
    while (!room_.parts.empty()) {
      std::pop_heap(room_.parts.begin(), room_.parts.end());
      const Part part = room_.parts.back();
      room_.parts.pop_back();
      if (part.known) {
        supports.lower(number, part.reach, part.reached);
        return true;
      }
      if (growsFreely(part.node) && !grow(part.node)) return false;
      if (side_.state(part.node) == State::kInner) {
        side_.children(part.node, [this](tree::NodeRef node) { addNode(node); });
      } else if (!addTriangles(part)) {
        return false;
      }
    }
    // A sampled oracle has lost all of the surface.
    supports.lower(number, supports.value(number), false);
    return true;
  }

 private:
  // Kept by the thread.
  struct Room {
    std::vector<Part> parts;  // a heap
    std::vector<std::uint32_t> triangles;
    std::vector<tree::Tree::Growth> growth;
  };
  static Room& room() {
    thread_local Room room;
    return room;
  }

  void add(const Part& part) {
    room_.parts.push_back(part);
    std::push_heap(room_.parts.begin(), room_.parts.end());
  }

  void addNode(tree::NodeRef node) {
    const NodeReach reach(side_.volume(node), Placement());
    double lo, hi;
    reach.along(direction_, lo, hi);
    add({hi + direction_.dot(reach.center - middle_), node});
  }

  // The part as its triangles know it, or, if it cannot be otherwise, its bounds.
  bool addTriangles(const Part& part) {
    const bool are_known = side_.tree().trianglesOf(part.node, left_, room_.triangles) && !room_.triangles.empty();
    left_ -= std::min(left_, room_.triangles.size());
    if (!are_known) {
      // Perhaps they only are too many for what is left now.
      if (has_all_effort_) add({part.reach, part.node, true, false});
      return has_all_effort_;
    }
    double reach = -std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : room_.triangles) {
      for (int k = 0; k < 3; ++k) reach = std::max(reach, direction_.dot(side_.corner(t, k) - middle_));
    }
    add({reach, part.node, true, true});
    return true;
  }

  bool growsFreely(tree::NodeRef node) const {
    return side_.state(node) == State::kGrows && side_.growsFreely(node) && side_.tree().hasRoom();
  }

  // Unless another thread grows the tree just now.
  bool grow(tree::NodeRef node) {
    if (left_ < kGrowthEffort) return false;
    left_ -= kGrowthEffort;
    has_all_effort_ = false;
    room_.growth.clear();
    side_.grow(node, room_.growth);
    tree::Tree::grow(room_.growth, false);
    return side_.state(node) == State::kInner;
  }

  const TreeSide& side_;
  Room& room_;
  const Eigen::Vector3d middle_ = Eigen::Vector3d::Constant(lattice::kMiddle);
  Eigen::Vector3d direction_;
  std::size_t left_ = kEffort;
  bool has_all_effort_ = true;  // for the direction that is asked about
};

void sharpen(const TreeSide& side, const std::int32_t (&near)[3][8]) {
  tree::Supports& supports = side.tree().supports();
  supports.reopen(side.tree().growth());
  Sharpening sharpening(side);
  for (int lane = 0; lane < 8; ++lane) {
    // The last look is at directions so close to each other that most are between the same.
    if (lane > 0 && near[0][lane] == near[0][lane - 1] && near[1][lane] == near[1][lane - 1]) continue;
    for (int k = 0; k < 3; ++k) {
      if (supports.isOpen(near[k][lane]) && !sharpening.ask(near[k][lane])) return;
    }
  }
}

}  // namespace

void sharpenSupports(const TreeSide& a, const TreeSide& b, const NearDirections& near) {
  if (near.lanes == 0) return;
  sharpen(a, near.of_a);
  sharpen(b, near.of_b);
}

}  // namespace bocst::query
