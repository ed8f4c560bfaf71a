// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <iterator>

#include "query/distance/distance_kernels.h"
#include "query/sides/box_side.h"
#include "query/sides/side.h"

namespace bocst::query {

/// Frames of the nodes of one side, see Frame. Kept by a thread: pairs come best first, so what was used lately is
/// often used again.
///
/// For sides that give the volumes of their lanes (BvhSide). Their coordinates become those of a lattice whose root is
/// the cube about all of them.
template <typename Side>
class SideFrames {
 public:
  using Node = typename Side::Node;

  /// To be called before anything else in a walk.
  void start(const Side& side, const PairFrames& geometry, int own) {
    geometry_ = &geometry;
    own_ = own;
    std::fill(std::begin(parents_), std::end(parents_), kNone);
    std::fill(std::begin(nodes_), std::end(nodes_), kNone);
    const Volume root = side.uprightVolume(side.root());
    for (int k = 0; k < 3; ++k) {
      middle_[k] = root.center[k];
      half_[k] = root.half[k];
    }
    per_unit_ = double(geometry.side[own].unit) / unitOf(side);
  }

  /// Where (x - origin) / unit are the coordinates of the lattice of a point x of the side's frame.
  static double unitOf(const Side& side) {
    const Volume root = side.uprightVolume(side.root());
    const double half = std::max({root.half[0], root.half[1], root.half[2]});
    return half / lattice::kMiddle;
  }
  static Eigen::Vector3d originOf(const Side& side) {
    const Volume root = side.uprightVolume(side.root());
    return Eigen::Vector3d(root.center[0], root.center[1], root.center[2]).array() - unitOf(side) * lattice::kMiddle;
  }

  /// Those of the lanes of an inner node.
  const Frame& ofLanes(const Side& side, Node node) {
    const std::size_t at = static_cast<std::size_t>(node) % kFrames;
    if (parents_[at] != node) {
      parents_[at] = node;
      Volume lanes[8] = {};
      side.laneVolumes(node, lanes);
      fill(lanes, 8, frames_[at]);
    }
    return frames_[at];
  }

  /// A frame that has the node itself in `lane`.
  const Frame& of(const Side& side, Node node, std::size_t& lane) {
    lane = 0;
    const std::size_t at = static_cast<std::size_t>(node) % kFrames;
    if (nodes_[at] != node) {
      nodes_[at] = node;
      const Volume volume = side.uprightVolume(node);
      fill(&volume, 1, own_frames_[at]);
    }
    return own_frames_[at];
  }

 private:
  static constexpr std::size_t kFrames = 64;
  static constexpr Node kNone = -1;

  // What they contain is in the root's box, too.
  void fill(const Volume* volumes, std::size_t count, Frame& frame) {
    LaneVolumes lanes = {};
    for (std::size_t i = 0; i < count; ++i) {
      const Volume& v = volumes[i];
      double offset = v.slab_offset;
      for (int k = 0; k < 3; ++k) {
        const double center = v.center[k] - middle_[k], half = v.half[k];
        const double low = std::max(center - half, -half_[k]), high = std::min(center + half, half_[k]);
        const double middle = (low + high) / 2;
        lanes.center[k][i] = static_cast<float>(middle * per_unit_);
        lanes.half[k][i] = static_cast<float>(std::max(high - low, 0.0) / 2 * per_unit_);
        lanes.normal[k][i] = v.normal[k];
        offset -= double(v.normal[k]) * (middle - center);
      }
      lanes.slab_center[i] = static_cast<float>(offset * per_unit_);
      lanes.slab_half[i] = static_cast<float>(double(v.slab_half) * per_unit_);
    }
    fillFrame(*geometry_, own_, lanes, frame);
  }

  const PairFrames* geometry_ = nullptr;
  int own_ = 0;
  double middle_[3], half_[3];  // of the box about all
  double per_unit_ = 0;         // the unit of frames for one of the side
  Node parents_[kFrames], nodes_[kFrames];
  Frame frames_[kFrames], own_frames_[kFrames];
};

/// Those of a tree. With conservative answers they bound the centres of the leaves' spheres, see fillCenters().
template <>
class SideFrames<TreeSide> {
 public:
  void start(const TreeSide& side, const PairFrames& geometry, int own) {
    geometry_ = &geometry;
    own_ = own;
    std::fill(std::begin(blocks_), std::end(blocks_), kNoBlock);
    const bounds::NodeBounds& root = side.tree().rootBounds();
    if (side.isConservative()) {
      fillCenters(geometry, own, root, leavesOf(side), root_);
    } else {
      fillFrame(geometry, own, root, root_);
    }
  }

  static double unitOf(const TreeSide&) { return 1; }
  static Eigen::Vector3d originOf(const TreeSide&) { return Eigen::Vector3d::Zero(); }

  const Frame& ofLanes(const TreeSide& side, tree::NodeRef node) { return ofBlock(side, side.block(node)); }

  const Frame& of(const TreeSide& side, tree::NodeRef node, std::size_t& lane) {
    lane = node.isRoot() ? 0 : static_cast<std::size_t>(node.octant());
    return node.isRoot() ? root_ : ofBlock(side, node.block());
  }

  static LeafCells leavesOf(const TreeSide& side) {
    const tree::Tree& tree = side.tree();
    LeafCells leaves{1 << (lattice::kMaxLevel - tree.deepest()), {}};
    std::copy_n(tree.surface().lattice.extent().data(), 3, leaves.extent.data());
    return leaves;
  }

 private:
  static constexpr std::size_t kFrames = 64;
  static constexpr std::uint32_t kNoBlock = 0xffffffff;

  const Frame& ofBlock(const TreeSide& side, std::uint32_t block) {
    const std::size_t at = block % kFrames;
    if (blocks_[at] != block) {
      blocks_[at] = block;
      const tree::Block& octants = side.tree().block(block);
      if (side.isConservative()) {
        fillCenters(*geometry_, own_, octants, leavesOf(side), frames_[at]);
      } else {
        fillFrame(*geometry_, own_, octants, frames_[at]);
      }
    }
    return frames_[at];
  }

  const PairFrames* geometry_ = nullptr;
  int own_ = 0;
  std::uint32_t blocks_[kFrames];
  Frame frames_[kFrames];
  Frame root_;
};

/// Oriented boxes are in the lattice of their tree.
template <>
class SideFrames<BoxSide> {
 public:
  static double unitOf(const BoxSide&) { return 1; }
  static Eigen::Vector3d originOf(const BoxSide&) { return Eigen::Vector3d::Zero(); }
};

/// From the lattice of side B to that of a tree, `b_in_a` being from the frame of B.
template <typename B>
SimilarityTransform betweenLattices(const B& b, const SimilarityTransform& b_in_a) {
  SimilarityTransform to = b_in_a;
  to.translation = b_in_a * SideFrames<B>::originOf(b);
  to.scale = b_in_a.scale * SideFrames<B>::unitOf(b);
  return to;
}

}  // namespace bocst::query
