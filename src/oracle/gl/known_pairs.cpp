// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/known_pairs.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "oracle/cpu/cpu_oracle.h"

namespace bocst::oracle::gl {
namespace {

constexpr int kPoses = 5;

}  // namespace

// Levels beyond the first `levels` are not resident.
KnownPairs::Tree KnownPairs::treeOf(const Surface& surface, int levels) {
  struct Entry {
    lattice::Cell cell;
    std::vector<std::uint32_t> ids;
    std::size_t parent;  // a word of the table; that of the root is none
  };
  constexpr std::size_t kNoParent = ~std::size_t{0};
  Tree t;
  t.tree.deepest = kDepth;
  std::copy_n(surface.lattice.extent().data(), 3, t.tree.extent);
  std::vector<Entry> entries(1);
  entries[0].parent = kNoParent;
  for (std::uint32_t i = 0; i < surface.triangle_count; ++i) entries[0].ids.push_back(i);
  for (std::size_t n = 0; n < entries.size(); ++n) {
    const Entry e = entries[n];
    if (e.cell.level == kDepth) {
      Eigen::Vector3d center, half;
      surface.lattice.region(e.cell, center, half);
      const Eigen::Vector3d p = center.array() - lattice::kMiddle;
      t.leaves.push_back({p[0], p[1], p[2], half.norm()});
      continue;
    }
    ExpansionRequest request;
    request.surface = &surface;
    request.cell = e.cell;
    request.ids = e.ids.data();
    request.count = e.ids.size();
    expand(request);
    const std::size_t at = t.words.size();
    if (e.cell.level < levels) {
      t.words.resize(at + node_table::kWords, node_table::kNone);
      t.words[at + node_table::kPlace] = e.cell.at[0] | e.cell.at[1] << 16;
      t.words[at + node_table::kShape] =
          e.cell.at[2] | static_cast<std::uint32_t>(e.cell.level) << 16 | std::uint32_t{request.grey} << 24;
      std::uint32_t& parent = e.parent == kNoParent ? t.tree.root : t.words[e.parent];
      parent = t.tree.blocks++;
    }
    for (std::size_t o = 0; o < 8; ++o) {
      if ((request.grey >> o & 1) == 0) continue;
      entries.push_back({e.cell.octant(static_cast<int>(o)),
                         {request.listBegin(static_cast<int>(o)), request.listEnd(static_cast<int>(o))},
                         at + node_table::kChildren + o});
    }
  }
  return t;
}

KnownPairs::KnownPairs(const Surface& a, const Surface& b) {
  for (const Surface* surface : {&a, &b}) {
    for (const int levels : {kDepth, 3}) trees_.push_back(treeOf(*surface, levels));
  }
  for (int i = 0; i < kPoses; ++i) {
    addPose(i, 0, 2, 1.0);
    addPose(i, 2, 0, 0.3);
    addPose(i, 0, 3, 1.7);
    addPose(i, 1, 1, 1.0);
  }
}

void KnownPairs::addPose(int number, std::uint32_t a, std::uint32_t b, double unit) {
  const double angle = 0.4 + 0.7 * number, far = (0.2 + 0.9 * number / kPoses) * 2 * lattice::kMiddle;
  const Eigen::Vector3d axis(std::sin(number), std::cos(2 * number), 0.3);
  const Eigen::Matrix3f rotation = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix().cast<float>();
  DeviceWalks::Pair pair;
  pair.tree[0] = a;
  pair.tree[1] = b;
  pair.unit = static_cast<float>(unit);
  pair.rounding_margin = 1e-5f * 4 * lattice::kMiddle;
  pair.not_smaller = unit < 1 ? -1 : 0;
  for (int j = 0; j < 3; ++j) {
    pair.shift[j] = static_cast<float>(far * std::sin(1.3 * number + 2 * j));
    for (int k = 0; k < 3; ++k) pair.rotation[j][k] = rotation(j, k);
  }
  const double close = 4 * static_cast<double>(pair.rounding_margin);
  Known known = Known::kApart;
  for (const auto& other : trees_[b].leaves) {
    if (known == Known::kMeet) break;
    double p[3];
    for (int j = 0; j < 3; ++j) {
      p[j] = static_cast<double>(pair.shift[j]);
      for (int k = 0; k < 3; ++k) {
        p[j] += static_cast<double>(pair.rotation[j][k]) * static_cast<double>(pair.unit) *
                other[static_cast<std::size_t>(k)];
      }
    }
    for (const auto& own : trees_[a].leaves) {
      const double way[3] = {p[0] - own[0], p[1] - own[1], p[2] - own[2]};
      const double distance = std::sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);  // hypot takes longer
      const double gap = distance - own[3] - static_cast<double>(pair.unit) * other[3];
      if (gap < -close) known = Known::kMeet;
      if (gap < close && known == Known::kApart) known = Known::kClose;
    }
  }
  pairs_.push_back(pair);
  known_.push_back(known);
}

bool KnownPairs::isFrontier(const Tree& t, std::uint32_t block, std::uint32_t octant) {
  if (block >= t.tree.blocks) return false;  // the root is resident
  const std::uint32_t* const row = t.words.data() + std::size_t{block} * node_table::kWords;
  const std::uint32_t level = (row[node_table::kShape] >> 16 & 0xff) + 1;
  return (row[node_table::kShape] >> (24 + octant) & 1) != 0 && level < t.tree.deepest &&
         row[node_table::kChildren + octant] == node_table::kNone;
}

std::string KnownPairs::ask(ComputeOracle& oracle) const {
  DeviceWalks walks;
  walks.pairs = pairs_;
  for (const Tree& t : trees_) {
    std::vector<std::uint32_t> words = t.words;
    walks.trees.push_back(t.tree);
    walks.trees.back().nodes = oracle.uploadNodes(words);
    if (walks.trees.back().nodes == nullptr) return "it takes no table of nodes";
  }
  oracle.walkPairs(walks);
  bool some_grow = false;
  for (std::size_t i = 0; i < walks.pairs.size(); ++i) {
    const unsigned found = walks.found[i];
    if (found == DeviceWalks::kUndone) return "pairs of trees were not walked";
    if (found == 0 && known_[i] == Known::kMeet) return "a contact between trees is lost";
    if ((found & DeviceWalks::kMeet) != 0 && known_[i] == Known::kApart) return "trees that are apart meet";
    // Of whole trees the device tells all but close ones.
    const bool is_whole = walks.pairs[i].tree[0] % 2 == 0 && walks.pairs[i].tree[1] % 2 == 0;
    const bool is_told = known_[i] == Known::kMeet ? (found & DeviceWalks::kMeet) != 0 : found == 0;
    if (is_whole && known_[i] != Known::kClose && !is_told) return "a walk over whole trees did not end";
    some_grow = some_grow || (found & (DeviceWalks::kGrows | DeviceWalks::kMeet)) == DeviceWalks::kGrows;
  }
  bool some_wanted = false;
  for (std::size_t t = 0; t < trees_.size(); ++t) {
    for (std::uint32_t bit = 0; bit < 32 * walks.trees[t].wanted.size(); ++bit) {
      if ((walks.trees[t].wanted[bit / 32] >> bit % 32 & 1) == 0) continue;
      some_wanted = true;
      if (!isFrontier(trees_[t], bit / 8, bit % 8)) return "nodes are asked for that are there, or cannot be";
    }
  }
  if (some_grow != some_wanted) return "nodes that must grow are not told";
  return "";
}

}  // namespace bocst::oracle::gl
