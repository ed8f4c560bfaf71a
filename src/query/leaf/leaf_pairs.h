// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <vector>

#include "oracle/cpu/kernels.h"
#include "query/leaf/large_triangles.h"
#include "query/leaf/leaf_corners.h"
#include "query/leaf/unpack.h"
#include "query/sides/side.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// The triangles of a leaf against the octants of smaller nodes of the other side: with large triangles the leaf's
/// volume says little.
template <typename Other>
class LargeTriangleLeaf {
 public:
  /// To be called before the first use in a walk.
  void clear() { leaf_.clear(); }

  /// The octants in `mask` of an inner node that a triangle of `leaf` meets.
  template <typename Side>
  unsigned octantsMeeting(const Side& side, const typename Side::Node& node, unsigned mask, const Other& other,
                          typename Other::Node leaf, const SimilarityTransform& other_in_side) {
    Eigen::Vector3d center;
    const double half = side.octantsOf(node, center), scale = 1 / half;
    const PackTransform place = packTransform(other, other_in_side, center, scale);
    if (!inRange(other_in_side.tolerance * scale)) return mask;
    const auto tolerance = static_cast<float>(other_in_side.tolerance * scale * 1.001);
    const std::size_t count = other.triangleCount(leaf);
    unsigned met = 0;
    for (std::size_t begin = 0; begin < count && (mask & ~met) != 0; begin += TrianglePack::kCapacity) {
      leaf_.take(other, leaf, begin);
      leaf_.place(place, pack_);
      if (!inRange(pack_)) return mask;
      std::uint8_t masks[TrianglePack::kCapacity];
      oracle::octantMasks(pack_.xyz[0], TrianglePack::kCapacity, leaf_.count(), tolerance, masks);
      for (std::size_t i = 0; i < leaf_.count(); ++i) met |= masks[i];
    }
    return mask & met;
  }

 private:
  LeafCorners<Other> leaf_;
  TrianglePack pack_;
};

/// Boxes about the single triangles of leaves, in the frame of the other side, whose nodes are smaller than the leaf.
template <typename Side>
class TriangleBoxes {
 public:
  struct Leaf {
    static constexpr std::size_t kCapacity = 32;
    std::uint32_t all() const { return ~0u >> (kCapacity - count); }

    typename Side::Node node{};
    std::uint64_t walk = 0;
    std::size_t count = 0;
    PlacedVolume boxes[kCapacity];
  };

  /// To be called before the first use in a walk.
  void clear() { ++walk_; }

  /// The boxes of a leaf; null if it has too many triangles. Good until the next call.
  const Leaf* get(const Side& side, typename Side::Node node, const SimilarityTransform& to) {
    Leaf& leaf = leaves_[numberOf(node) % kLeaves];
    if (leaf.walk == walk_ && leaf.node == node) return &leaf;
    const auto triangles = side.triangles(node);
    if (triangles.count > Leaf::kCapacity) return nullptr;
    leaf.node = node;
    leaf.walk = walk_;
    leaf.count = triangles.count;
    for (std::size_t i = 0; i < leaf.count; ++i) {
      leaf.boxes[i] = placed(boxAbout(side.corners(triangles.ids[i])), to);
    }
    return &leaf;
  }

 private:
  static constexpr std::size_t kLeaves = 16;
  Leaf leaves_[kLeaves];
  std::uint64_t walk_ = 0;
};

/// What bounds a leaf's triangles, as far as they are its own: a box and a slab, in its own frame [0] and, once placed
/// there, in that of the other side [1].
struct LeafVolume {
  LeafVolume() = default;

  explicit LeafVolume(const Volume& v) : slab{v.slab_offset, v.slab_half} {
    for (int k = 0; k < 3; ++k) {
      center[0][k] = v.center[k];
      half[0][k] = v.half[k];
      normal[0][k] = v.normal[k];
    }
  }

  explicit LeafVolume(const OrientedVolume& v) {
    const Eigen::Vector3d own = v.axes.cwiseAbs() * v.half;
    for (int k = 0; k < 3; ++k) {
      center[0][k] = v.center[k];
      half[0][k] = own[k];
    }
  }

  /// Leaves out what lies beyond a cut in its own frame. To be placed again.
  void cutOff(const Cut& cut) {
    const Eigen::Vector3d least(center[0][0] - half[0][0], center[0][1] - half[0][1], center[0][2] - half[0][2]);
    for (int k = 0; k < 3; ++k) {
      const double beyond = std::max(2 * half[0][k] - cut.reach(least, k), 0.0);
      center[0][k] -= beyond / 2;
      half[0][k] -= beyond / 2;
      slab[0] += normal[0][k] * beyond / 2;
    }
  }

  void place(const SimilarityTransform& to_other) {
    const Eigen::Matrix3d turn = to_other.rotation.cwiseAbs();
    const Eigen::Vector3d c = to_other * Eigen::Vector3d(center[0][0], center[0][1], center[0][2]);
    for (int k = 0; k < 3; ++k) {
      center[1][k] = c[k];
      half[1][k] = to_other.scale * (turn(k, 0) * half[0][0] + turn(k, 1) * half[0][1] + turn(k, 2) * half[0][2]);
      normal[1][k] = 0;
      for (int j = 0; j < 3; ++j) normal[1][k] += to_other.rotation(k, j) * normal[0][j];
    }
    placed = true;
  }

  double center[2][3];
  double half[2][3];
  double normal[2][3] = {};  ///< Of the slab, about unit length; zero: no slab.
  double slab[2] = {};       ///< Along normal, from center: its middle and half its thickness, in own units.
  bool placed = false;
};

/// The leaves of one side that a walk has met, packed: triangles are about the middle of their leaf's box.
template <typename Side>
class LeafPacks {
 public:
  struct Leaf {
    typename Side::Node node{};
    std::size_t begin = 0;
    std::size_t all = 0;  ///< Triangles of the leaf, those in other packs included.
    std::uint64_t walk = 0;
    float error = 0;  ///< Corners may be so far from where they are, beside the rounding of floats.
    LeafVolume volume;
    TrianglePack pack;
    tree::TriangleIds listed;  ///< The triangles' numbers where the tree keeps them, else in `own`.
    std::uint32_t own[TrianglePack::kCapacity];

    void prefetchIds() const {
      if (listed.areKnown()) listed.prefetch();
    }
    std::uint32_t id(std::size_t i) const { return listed.areKnown() ? listed[i] : own[i]; }
  };

  /// To be called before the first use in a walk.
  void clear() {
    ++walk_;
    used_ = 0;
  }

  /// At most a pack of the leaf's triangles, from the one at `begin`; good until the next call.
  const Leaf& get(const Side& side, typename Side::Node node, std::size_t begin, const SimilarityTransform& to_other) {
    Leaf& leaf = find(side, node, begin);
    if (!leaf.volume.placed) leaf.volume.place(to_other);
    return leaf;
  }

  /// The same without the leaf's volume in the other side's frame.
  const Leaf& get(const Side& side, typename Side::Node node, std::size_t begin) { return find(side, node, begin); }

 private:
  static constexpr std::size_t kLeaves = 256;

  Leaf& find(const Side& side, typename Side::Node node, std::size_t begin) {
    std::uint16_t& slot = slots_[(numberOf(node) + begin) % (4 * kLeaves)];
    if (slot < leaves_.size() && leaves_[slot].walk == walk_ && leaves_[slot].node == node &&
        leaves_[slot].begin == begin) {
      return leaves_[slot];
    }
    // A walk that meets few leaves stays in the first, which are in the processor's cache.
    slot = static_cast<std::uint16_t>(used_++ % kLeaves);
    if (slot == leaves_.size()) leaves_.emplace_back();
    Leaf& leaf = leaves_[slot];
    leaf.node = node;
    leaf.begin = begin;
    leaf.walk = walk_;
    leaf.volume = LeafVolume(side.volume(node));
    fill(side, leaf);
    return leaf;
  }

  void fill(const Side& side, Leaf& leaf) {
    const double(&c)[3] = leaf.volume.center[0];
    if constexpr (std::is_same<Side, TreeSide>::value) {
      tree::PackedTriangles packed;
      if (side.packed(leaf.node, packed, leaf.listed)) {
        PackMotion motion{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {}};
        for (int k = 0; k < 3; ++k) motion.offset[k] = static_cast<float>(static_cast<double>(packed.origin[k]) - c[k]);
        unpackTriangles(packed, motion, leaf.pack);
        leaf.all = packed.count;
        // The last is what unpacking rounds more than placing does.
        leaf.error = packingError(packed) + 1.7321f * 2 * 0x1p-24f * leaf.pack.size;
        return;
      }
    }
    corners_.clear();
    corners_.take(side, leaf.node, leaf.begin);
    corners_.place(packTransform(side, SimilarityTransform(), Eigen::Vector3d(c[0], c[1], c[2]), 1), leaf.pack);
    leaf.all = side.triangleCount(leaf.node);
    leaf.error = 0;
    leaf.listed = {};
    for (std::size_t i = 0; i < leaf.pack.count; ++i) leaf.own[i] = corners_.id(i);
  }

  std::vector<Leaf> leaves_;
  std::uint16_t slots_[4 * kLeaves] = {};
  std::size_t used_ = 0;
  std::uint64_t walk_ = 1;
  LeafCorners<Side> corners_;
};

/// Leaves against leaves, triangle by triangle.
template <typename A, typename B>
class LeafPairs {
 public:
  /// To be called before the first test of a walk. `one_will_do`: the first pair that touches ends it. What lies beyond
  /// `cut`, which may be null, is left out of the tests of leaves.
  void start(const SimilarityTransform& b_in_a, const SimilarityTransform& a_in_b, bool one_will_do, const Cut* cut) {
    leaves_a_.clear();
    leaves_b_.clear();
    tested_ = 0;
    to_a_ = turnOf(b_in_a);
    b_in_a_ = &b_in_a;
    a_in_b_ = &a_in_b;
    one_will_do_ = one_will_do;
    cut_ = cut;
  }

  /// Pairs of triangles that were tested since start().
  std::size_t tested() const { return tested_; }

  /// Calls f(triangle of a, triangle of b, whether they surely meet) for the pairs that are not surely apart, until it
  /// returns true. A pair may be left to other leaves where it touches, too.
  template <typename F>
  bool test(const A& a, typename A::Node node_a, const B& b, typename B::Node node_b, F&& f) {
    for (std::size_t i = 0;;) {
      const auto& leaf_a = leaves_a_.get(a, node_a, i, *a_in_b_);
      for (std::size_t j = 0;;) {
        const auto& leaf_b = leaves_b_.get(b, node_b, j, *b_in_a_);
        if (testPacks(leaf_a, leaf_b, f)) return true;
        j += TrianglePack::kCapacity;
        if (j >= leaf_b.all) break;
      }
      i += TrianglePack::kCapacity;
      if (i >= leaf_a.all) return false;
    }
  }

  /// The same for a leaf of one side and those triangles of a larger one of the other that may meet it, a bit each. For
  /// pairs that PairFrames fits: so corners and tolerance are in range, and what is too small is never parted in float.
  template <typename F>
  bool testLargeA(const LargeTriangles& a, std::uint32_t which, const B& b, typename B::Node node_b, F&& f) {
    return testLarge(leaves_b_, b, node_b, a, which, *a_in_b_,
                     [&f](std::uint32_t t, std::uint32_t u, bool certain) { return f(u, t, certain); });
  }
  template <typename F>
  bool testLargeB(const A& a, typename A::Node node_a, const LargeTriangles& b, std::uint32_t which, F&& f) {
    return testLarge(leaves_a_, a, node_a, b, which, *b_in_a_, f);
  }

 private:
  template <typename F>
  bool testPacks(const typename LeafPacks<A>::Leaf& a, const typename LeafPacks<B>::Leaf& b, F&& f) {
    if (!inRange(a.pack) || !inRange(b.pack) || !inRange(b_in_a_->tolerance)) return allPairs(a, b, f);
    a.prefetchIds();
    b.prefetchIds();
    // What touches within both leaves does so within both boxes and both slabs.
    PackRegion region;
    if (cut_ == nullptr) {
      fillRegion(b.volume, a.volume, *a_in_b_, b.pack.size, b.error, region);
    } else {
      LeafVolume before_cut = a.volume;
      before_cut.cutOff(*cut_);
      before_cut.place(*a_in_b_);
      fillRegion(b.volume, before_cut, *a_in_b_, b.pack.size, b.error, region);
    }
    const std::uint32_t lanes = trianglesWithin(b.pack, region);
    if (lanes == 0) return false;
    fillRegion(a.volume, b.volume, *b_in_a_, a.pack.size, a.error, region, cut_);
    const std::uint32_t rows = trianglesWithin(a.pack, region);
    if (rows == 0) return false;
    for (int k = 0; k < 3; ++k) to_a_.offset[k] = static_cast<float>(b.volume.center[1][k] - a.volume.center[0][k]);
    moveTriangles(b.pack, lanes, to_a_, lanes_);
    if (!inRange(lanes_)) return allPairs(a, b, f);
    std::uint32_t ids[TrianglePack::kCapacity], *id = ids;
    for (std::uint32_t left = lanes; left != 0; left &= left - 1)
      *id++ = b.id(static_cast<std::size_t>(__builtin_ctz(left)));
    const double error = static_cast<double>(a.error) + b_in_a_->scale * static_cast<double>(b.error);
    tested_ += static_cast<std::size_t>(__builtin_popcount(rows)) * lanes_.count;
    return reportPairs(a.pack, rows, lanes_, region, *b_in_a_, error, nullptr, placedCut(false, a.volume.center[0]),
                       [&](const PackPair& pair) { return f(a.id(pair.row), ids[pair.lane], pair.certain); });
  }

  // The cut as packs see it; origin: the coordinate along its direction of the place that they are about.
  struct PlacedCut {
    double origin;
    PackCut cut;
  };

  // Where there is a cut. `middle`: of the packs, in the frame of side B or else A.
  PlacedCut placedCut(bool in_b, const double (&middle)[3]) const {
    if (cut_ == nullptr) return {};
    Eigen::RowVector3d row = cut_->direction;
    double origin = 0;
    if (in_b) {
      origin = row.dot(b_in_a_->translation);
      row *= b_in_a_->scale * b_in_a_->rotation;
    }
    const Eigen::RowVector3f direction = row.cast<float>();
    origin += row.dot(Eigen::Vector3d(middle[0], middle[1], middle[2]));
    return {origin, {{direction[0], direction[1], direction[2]}, static_cast<float>(cut_->most() - origin)}};
  }

  // Calls f for the pairs of touchingPairs(), where there is a cut only for those that may lie before it. Those that
  // begin first come first then, as f lowers the cut.
  template <typename F>
  bool reportPairs(const TrianglePack& rows, std::uint32_t which, const TrianglePack& lanes, const PackRegion& region,
                   const SimilarityTransform& to, double error, const PackSlabs* slabs, const PlacedCut& placed,
                   F&& f) {
    const auto [tolerance, margin] = limits(to, error);
    const bool is_cut = cut_ != nullptr && to.margin == 0;
    std::size_t found = touchingPairs(rows, which, lanes, region, tolerance, margin, one_will_do_, found_, slabs,
                                      is_cut ? &placed.cut : nullptr);
    if (!is_cut) {
      return std::any_of(found_, found_ + found, f);
    }
    const auto later = [](const PackPair& x, const PackPair& y) { return x.least > y.least; };
    std::make_heap(found_, found_ + found, later);
    for (; found > 0 && !cut_->isBeyond(placed.origin + static_cast<double>(found_[0].least)); --found) {
      std::pop_heap(found_, found_ + found, later);
      if (f(found_[found - 1])) return true;
    }
    return false;
  }

  // All about the middle of the smaller leaf's box, as its packed corners are. Calls f(triangle of that leaf, large
  // triangle, whether they surely meet).
  template <typename Side, typename F>
  bool testLarge(LeafPacks<Side>& leaves, const Side& side, typename Side::Node node, const LargeTriangles& large,
                 std::uint32_t which, const SimilarityTransform& to, F&& f) {
    for (std::size_t begin = 0;; begin += TrianglePack::kCapacity) {
      const auto& leaf = leaves.get(side, node, begin);
      const double(&c)[3] = leaf.volume.center[0];
      large.takeRows(which, c, rows_, slabs_);
      std::uint32_t ids[TrianglePack::kCapacity], *id = ids;
      for (std::uint32_t left = which; left != 0; left &= left - 1) {
        *id++ = large.id(static_cast<std::size_t>(__builtin_ctz(left)));
      }
      if (testRows(leaf, to, ids, placedCut(&to == a_in_b_, c), f)) return true;
      if (begin + TrianglePack::kCapacity >= leaf.all) return false;
    }
  }

  template <typename Leaf, typename F>
  bool testRows(const Leaf& leaf, const SimilarityTransform& to, const std::uint32_t* ids, const PlacedCut& placed,
                F&& f) {
    PackRegion region{};
    const double size = static_cast<double>(leaf.pack.size), error = static_cast<double>(leaf.error);
    const double rounding_margin = regionMargin(to, to.tolerance, size, error);
    for (int k = 0; k < 3; ++k) {
      region.high[k] = static_cast<float>(leaf.volume.half[0][k] + rounding_margin);
      region.low[k] = -region.high[k];
    }
    const std::uint32_t all = rows_.count < 32 ? (1u << rows_.count) - 1 : ~0u;
    tested_ += rows_.count * leaf.pack.count;
    return reportPairs(rows_, all, leaf.pack, region, to, error, &slabs_, placed,
                       [&](const PackPair& pair) { return f(leaf.id(pair.lane), ids[pair.row], pair.certain); });
  }

  /// Tolerance and margin of touchingPairs(), of corners that are off by `error`.
  static std::pair<float, float> limits(const SimilarityTransform& to, double error) {
    return {static_cast<float>((to.tolerance + error) * 1.001), static_cast<float>((to.margin - error) * 0.999)};
  }

  /// Calls f for all pairs: for coordinates beyond the range of floats.
  template <typename F>
  static bool allPairs(const typename LeafPacks<A>::Leaf& a, const typename LeafPacks<B>::Leaf& b, F&& f) {
    for (std::size_t i = 0; i < a.pack.count; ++i) {
      for (std::size_t j = 0; j < b.pack.count; ++j) {
        if (f(a.id(i), b.id(j), false)) return true;
      }
    }
    return false;
  }

  /// Where the triangles of a leaf can meet those of another, which `to` places in its frame. With M = `extent`, what
  /// is computed here and by trianglesWithin() is off by 15 u M: corners 2, the normal 3, sums along it 10.
  static void fillRegion(const LeafVolume& own, const LeafVolume& other, const SimilarityTransform& to, double size,
                         float error, PackRegion& region, const Cut* cut = nullptr) {
    double displacement[3], extent = size, offset = to.scale * other.slab[0];
    for (int k = 0; k < 3; ++k) {
      displacement[k] = other.center[1][k] - own.center[0][k];
      extent = std::max(extent, std::abs(displacement[k]) + other.half[1][k]);
      offset += other.normal[1][k] * displacement[k];
      region.normal[k] = static_cast<float>(other.normal[1][k]);
    }
    const double rounding_margin = regionMargin(to, to.tolerance, extent, static_cast<double>(error));
    for (int k = 0; k < 3; ++k) {
      region.low[k] =
          static_cast<float>(std::max(-own.half[0][k], displacement[k] - other.half[1][k]) - rounding_margin);
      region.high[k] =
          static_cast<float>(std::min(own.half[0][k], displacement[k] + other.half[1][k]) + rounding_margin);
    }
    if (cut != nullptr) {
      Eigen::Vector3d least;
      for (int k = 0; k < 3; ++k) least[k] = own.center[0][k] + static_cast<double>(region.low[k]);
      for (int k = 0; k < 3; ++k) {
        const double reach = cut->reach(least, k) + rounding_margin;
        region.high[k] = std::min(region.high[k], static_cast<float>(static_cast<double>(region.low[k]) + reach));
      }
    }
    const double half = to.scale * other.slab[1] + rounding_margin;
    region.slab_low = static_cast<float>(offset - half);
    region.slab_high = static_cast<float>(offset + half);
  }

  LeafPacks<A> leaves_a_;
  LeafPacks<B> leaves_b_;
  PackMotion to_a_;
  TrianglePack lanes_, rows_;
  PackSlabs slabs_{};  // of rows_
  const SimilarityTransform *b_in_a_ = nullptr, *a_in_b_ = nullptr;
  bool one_will_do_ = false;
  std::size_t tested_ = 0;
  const Cut* cut_ = nullptr;
  PackPair found_[TrianglePack::kCapacity * TrianglePack::kCapacity];
};

}  // namespace bocst::query
