// SPDX-License-Identifier: BSD-3-Clause
#include "query/distance/tree_gaps.h"

#include <algorithm>
#include <cmath>

#include "thread/of_thread.h"

namespace bocst::query {
namespace {

constexpr double kHalfDiagonal = 0.8660254037844387;  // of a cube of side 1

}  // namespace

/// The triangles of a leaf in the frame of the other side, as triangleGaps() sees them.
struct TreeGaps::LargeLeaf {
  tree::NodeRef leaf;
  std::size_t count = 0;  // nothing is held when it is 0
  TriangleBounds bounds;
};

/// Frames of one thread. Pairs come best first, so what was used lately is often used again.
struct TreeGaps::Scratch {
  static constexpr std::size_t kFrames = 64;
  static constexpr std::size_t kLargeLeaves = 8;
  static constexpr std::uint32_t kNoBlock = 0xffffffff;

  std::uint32_t blocks[2][kFrames];
  Frame frames[2][kFrames];
  Frame roots[2];
  LargeLeaf large[2][kLargeLeaves];
  RawTriangles raw, placed;
};

TreeGaps::Scratch& TreeGaps::scratch() { return thread::ofThread<Scratch>(); }

TreeGaps::TreeGaps(const TreeSide& a, const TreeSide& b, const SimilarityTransform& b_in_a)
    : side_{&a, &b}, b_in_a_(b_in_a), geometry_(b_in_a) {
  Scratch& s = scratch();
  for (int side = 0; side < 2; ++side) {
    std::fill(std::begin(s.blocks[side]), std::end(s.blocks[side]), Scratch::kNoBlock);
    const bounds::NodeBounds& root = side_[side]->tree().rootBounds();
    if (side_[side]->isConservative()) {
      const LeafCells leaves = leavesOf(side);
      const double radius = kHalfDiagonal * leaves.side * (side == 0 ? 1 : b_in_a.scale);
      radii_ += static_cast<float>(radius * (1 + 0x1p-20));
      const bool is_clipped = std::any_of(leaves.extent.begin(), leaves.extent.end(),
                                          [&](std::int32_t end) { return end % leaves.side != 0; });
      if (is_clipped) doubt_ += radius;
      fillCenters(geometry_, side, root, leaves, s.roots[side]);
    } else {
      fillFrame(geometry_, side, root, s.roots[side]);
    }
    for (LargeLeaf& leaf : s.large[side]) leaf.count = 0;
  }
  doubt_ += 4 * static_cast<double>(geometry_.slab_rounding_margin);
}

void TreeGaps::expect(const Eigen::Vector3d& direction) {
  const Eigen::Vector3d back = b_in_a_.rotation.transpose() * direction;
  for (int k = 0; k < 3; ++k) {
    direction_.in[0][k] = static_cast<float>(direction[k]);
    direction_.in[1][k] = static_cast<float>(back[k]);
  }
}

LeafCells TreeGaps::leavesOf(int side) const {
  const tree::Tree& tree = side_[side]->tree();
  LeafCells leaves{1 << (lattice::kMaxLevel - tree.deepest()), {}};
  std::copy_n(tree.surface().lattice.extent().data(), 3, leaves.extent.data());
  return leaves;
}

const Frame& TreeGaps::frame(int side, std::uint32_t block) {
  Scratch& s = scratch();
  const std::size_t at = block % Scratch::kFrames;
  if (s.blocks[side][at] != block) {
    s.blocks[side][at] = block;
    const tree::Block& octants = side_[side]->tree().block(block);
    if (side_[side]->isConservative()) {
      fillCenters(geometry_, side, octants, leavesOf(side), s.frames[side][at]);
    } else {
      fillFrame(geometry_, side, octants, s.frames[side][at]);
    }
  }
  return s.frames[side][at];
}

const Frame& TreeGaps::frameOf(int side, tree::NodeRef node, std::size_t& lane) {
  if (node.isRoot()) {
    lane = 0;
    return scratch().roots[side];
  }
  lane = static_cast<std::size_t>(node.octant());
  return frame(side, node.block());
}

OctantGaps TreeGaps::ofOctants(int own, tree::NodeRef x, tree::NodeRef y) {
  std::size_t lane = 0;
  const Frame& f = frame(own, side_[own]->block(x));
  const Frame& other = frameOf(1 - own, y, lane);
  OctantGaps gaps;
  octantGaps(geometry_, own, f, other, lane, direction_, gaps);
  if (radii_ > 0) {
    for (float& gap : gaps.at_least) gap = std::max(gap * (1 - 0x1p-22f) - radii_, 0.0f);
  }
  return gaps;
}

const TreeGaps::LargeLeaf& TreeGaps::largeLeaf(int side, tree::NodeRef leaf) {
  constexpr double kNowhere = 1e30;
  Scratch& s = scratch();
  LargeLeaf& large = s.large[side][leaf.bits % Scratch::kLargeLeaves];
  if (large.count != 0 && large.leaf == leaf) return large;
  const tree::TriangleList list = side_[side]->triangles(leaf);
  large.leaf = leaf;
  large.count = list.count;
  const std::uint32_t all = ~0u >> (TriangleBounds::kCapacity - large.count);
  readCorners(*side_[side], list.ids, all, s.raw);
  const SimilarityTransform in_other = side == 1 ? b_in_a_ : b_in_a_.inverse();
  const PackTransform place = packTransform(*side_[side], in_other, Eigen::Vector3d::Constant(lattice::kMiddle), 1);
  boundTriangles(s.raw, all, place, static_cast<double>(geometry_.side[1 - side].unit), kNowhere, s.placed,
                 large.bounds);
  return large;
}

OctantGaps TreeGaps::ofOctantsBeside(int own, tree::NodeRef x, tree::NodeRef y) {
  OctantGaps gaps = ofOctants(own, x, y);
  const std::size_t count = side_[1 - own]->triangleCount(y);
  if (count > TriangleBounds::kCapacity) return gaps;
  const LargeLeaf& large = largeLeaf(1 - own, y);
  triangleGaps(geometry_, frame(own, side_[own]->block(x)), large.bounds, large.count, gaps);
  return gaps;
}

// As fillCenters() has it. Adds the radius that no leaf's sphere exceeds.
NodeExtent TreeGaps::extentOf(int side, tree::NodeRef node, double& radii) const {
  const SimilarityTransform here, &to = side == 0 ? here : b_in_a_;
  const Volume v = side_[side]->volume(node);
  if (!side_[side]->isConservative()) return {v, to};
  const LeafCells leaves = leavesOf(side);
  const lattice::Cell cell = side_[side]->tree().cell(node);
  const double leaf = leaves.side, cells = cell.side() / leaf;
  OrientedVolume centers;
  Eigen::Vector3d largest;
  for (int k = 0; k < 3; ++k) {
    const auto i = static_cast<std::size_t>(k);
    const double corner = cell.corner()[i], half = double(v.half[i]), end = leaves.extent[i];
    const double lo = (v.center[i] - half - corner) / leaf, hi = (v.center[i] + half - corner) / leaf;
    const double first = std::clamp(std::floor(lo - kPartOfCell), 0.0, cells - 1),
                 last = std::clamp(std::ceil(hi + kPartOfCell) - 1, first, cells - 1);
    const double low = corner + first * leaf, high = corner + last * leaf;
    const double least = (low + std::min(low + leaf, end)) / 2, most = (high + std::min(high + leaf, end)) / 2;
    centers.center[k] = (least + most) / 2;
    centers.half[k] = (most - least) / 2;
    largest[k] = least - low;
  }
  radii += largest.norm() * to.scale;
  return {centers, to};
}

double TreeGaps::ofSpheres(tree::NodeRef a, tree::NodeRef b, const Eigen::Vector3d& direction, double cutoff) const {
  double radii = 0;
  const NodeExtent extent_a = extentOf(0, a, radii), extent_b = extentOf(1, b, radii);
  return distanceBound(extent_a, extent_b, direction, cutoff + radii) - radii;
}

}  // namespace bocst::query
