// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

#include "query/collide/step_state.h"
#include "query/cull/frames.h"
#include "query/leaf/large_triangles.h"
#include "query/sides/visitor.h"

namespace bocst::query {

/// A leaf of large triangles that was asked which of them may meet a node of the other side.
struct AskedLeaf {
  static constexpr std::uint32_t kNone = 2;

  std::uint32_t side = kNone;   ///< Whose leaf it is, if one was asked.
  std::uint32_t triangles = 0;  ///< Those that may meet, a bit each.
};

/// Octants of one block against one node of the other side, still to be walked. Words of one size, see
/// copyWords().
struct StepGroup {
  StepNode other;
  BlockView own;
  std::uint32_t octants;  ///< A bit each.
  std::uint32_t late;     ///< Those of them that wait until the others are gone.
  /// Of each octant: how far it overlaps the other node, as the bits of a float, of which the lowest three are the
  /// octant. Not changed when octants are taken: what was just written in parts is slow to be read as a whole.
  std::uint32_t order[8];
  std::uint32_t asked;         ///< AskedLeaf::side of each octant and the other node ...
  std::uint32_t triangles[8];  ///< ... and AskedLeaf::triangles.
};

/// What a walk came to.
struct StepEvent {
  enum Kind {
    kDone,      ///< The stack is empty; nothing else is set.
    kLeaves,    ///< `pair` is two leaves, to be tested; see `asked`.
    kDeferred,  ///< `pair` needs a node that is not expanded.
    /// `pair` is a leaf and a smaller node: the octants in `mask` of `block`, the smaller node's, overlap the
    /// volume of the leaf, whose triangles are to be asked. `asked` says which of them are left, if they were before.
    kLargeTriangles,
  };

  Kind kind = kDone;
  StepNode pair[2];
  AskedLeaf asked;
  BlockView block;    ///< kLargeTriangles only.
  unsigned mask = 0;  ///< kLargeTriangles only.
};

/// The state of the depth-first walk over resident pairs of two trees, of which one at least has exact answers.
struct PairSteps {
  /// Blocks below one another: of cells, then loose ones.
  static constexpr std::size_t kMostDepth = lattice::kMaxLevel + tree::kMostLooseDepth;
  /// Frames in use at once: two for the nodes of a pair that was pushed without, and one for each block of either side.
  static constexpr std::size_t kFrames = 2 + 2 * kMostDepth + 1;
  /// Groups that a walk below one pair can add: one for each block of either side, eight where two blocks go at once.
  static constexpr std::size_t kStackRoom = 8 * kMostDepth + 1;

  const TreeSide* side[2];  ///< They see the same root all the time, while a helper thread may publish another.
  const tree::Tree* tree[2];
  std::int64_t now[2];  ///< By the clock of each side.
  PairFrames geometry;
  Frame* frames;     ///< kFrames of them.
  StepGroup* stack;  ///< With room for kStackRoom more, below `stack_end`.
  const StepGroup* stack_end = nullptr;
  std::size_t depth = 0;

  const LevelRule level_rule;

  bool has_cells[2];            ///< Leaves of this side are cells of the collision depth; else lists of triangles.
  std::uint32_t leaf_level[2];  ///< The deepest level of each side.

  /// The other node of a pair is expanded for all octants of a group at once, so that their tests overlap in time. Set
  /// where a hit is not expected or does not end the walk; else the first hit makes most of these tests unnecessary.
  bool all_at_once = false;

  /// No hit ends the walk: what is on the stack will be walked, so it is fetched ahead.
  bool sees_all = false;

  /// Octants are taken in the order of their numbers, not the deepest overlap first.
  bool in_order = false;

  /// Where it is cut, nodes whose least coordinate along this direction, in the frame of side 0, is larger than `cut`
  /// are left out; octants come in the order of these coordinates.
  bool is_cut = false;
  float cut_direction[3];
  float cut;
  void setCut(const Cut& c) {
    is_cut = true;
    for (int k = 0; k < 3; ++k) cut_direction[k] = static_cast<float>(c.direction[k]);
    const double size = c.direction.sum();  // of entries that are not negative
    cut = static_cast<float>(c.last - size * lattice::kMiddle) + static_cast<float>(size) * geometry.rounding_margin;
  }

  /// The same where a side has cells, by their ids. Null: nothing is left out.
  const Cut* cell_cut = nullptr;
  bool isBeyondCellCut(tree::NodeRef a, tree::NodeRef b) const {
    return (has_cells[0] ? side[0]->firstCellId(a) : side[1]->firstCellId(b)) > cell_cut->last_cell;
  }

  /// Where a side has cells: the spheres of its leaves and of so many levels above, which hold those below them, in
  /// frames as `frames`, decoded when asked for. A sphere and a volume that are apart by more than `sphere_margin` do
  /// not touch.
  static constexpr std::uint32_t kSphereLevels = 2;
  SphereFrame* spheres = nullptr;
  float sphere_margin = 0;
  CellTree cells{};
  std::uint64_t spheres_hold[kFrames];
  void setSpheres(SphereFrame* frames_of_spheres, float margin) {
    spheres = frames_of_spheres;
    sphere_margin = margin;
    cells = cellTreeOf(*tree[has_cells[0] ? 0 : 1]);
    for (std::uint64_t& h : spheres_hold) h = kEmptyFrame;
  }

  const LargeTriangles* leaf[2] = {nullptr, nullptr};  ///< Of each side, those of the larger leaf placed last.

  std::uint64_t holds[kFrames];  ///< frameName() of what is in a frame.

  PairSteps(const TreeSide& a, const TreeSide& b, const PairFrames& geometry_, Frame* frames_)
      : side{&a, &b},
        tree{&a.tree(), &b.tree()},
        now{a.now(), b.now()},
        geometry(geometry_),
        frames(frames_),
        stack(nullptr),
        // Units are floats, and so is their quotient.
        level_rule(LevelRule::of(static_cast<double>(geometry.side[1].unit / geometry.side[0].unit))),
        has_cells{a.isConservative(), b.isConservative()},
        leaf_level{static_cast<std::uint32_t>(a.tree().deepest()), static_cast<std::uint32_t>(b.tree().deepest())} {
    for (std::uint64_t& h : holds) h = kEmptyFrame;
  }
};

/// Goes on to the next event. Chosen at run time for the machine's instruction set.
void nextEvent(PairSteps& steps, StepEvent& event);

/// After kLargeTriangles: puts those octants on the stack that the leaf's triangles in `triangles` may meet, of which
/// LargeTriangles knows the places.
void pushMeeting(PairSteps& steps, const StepEvent& event, std::uint32_t triangles);

/// After kLargeTriangles: puts the octants in `mask` on the stack.
void pushOctants(PairSteps& steps, const StepEvent& event, unsigned mask);

/// Puts a pair of nodes on the stack that comes without frames.
void pushPair(PairSteps& steps, tree::NodeRef node_a, tree::NodeRef node_b);

/// The octants of a cell, wherever they come from.
struct CellOctants {
  lattice::Cell cell;
  bounds::OctantBounds octants;
};

/// What a step computes, by itself: bit o is set unless octant o of a cell of side `own` is surely apart from octant
/// `octant` of a cell of the other side.
std::uint8_t overlappingOctants(const PairFrames& geometry, int own, const CellOctants& cell, const CellOctants& other,
                                int octant);

/// The test of pushMeeting() by itself, for at most 32 triangles: bit t of met[o] is set unless triangle t surely
/// misses octant o of a cell of side `own`.
///
/// Along the axes of the octants, the triangle's normal and those of its edges in its plane; along the normal the
/// octant's slab counts, too. With Q half a root's side and u = 2^-24, a centre is off by 9 u Q, an extent by 3, a
/// projection on an axis of unit sum by 4 and a radius by 4 more, sums of both by 3, a bound by 2: 25 u Q. Slabs add
/// 41: their offset 11, their normal 3, what the normals differ by 5, sums 22. PairFrames::Side::rounding_margin takes
/// 128.
void octantsMeeting(const PairFrames& geometry, int own, const CellOctants& cell, const TriangleBounds& triangles,
                    std::size_t count, std::uint32_t (&met)[8]);

}  // namespace bocst::query
