// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

// Oriented boxes of placed objects, in float about the scene's origin, and which of them are near. Lengths are those of
// the scene. Chosen at run time for the machine's instruction set.

namespace bocst::scene {

/// Around one object. `reach` is how much farther than the box it may touch: its margin, and all that rounding does.
struct Box {
  float center[3];
  float axis[3][3];  ///< axis[k]: about unit vectors
  float half[3];     ///< along them
  float reach;
  float lo[3], hi[3];  ///< The box along the axes of the world, reach included.
};

/// Eight of them, structure of arrays. A lane without an object has an empty lo/hi in groups of fixed objects, and may
/// hold anything in those of moving ones, where masks leave it out.
struct alignas(64) BoxGroup {
  float center[3][8];
  float axis[3][3][8];
  float half[3][8];
  float reach[8];
  float lo[3][8], hi[3][8];

  BoxGroup();  ///< All lanes are empty.
  void set(std::size_t lane, const Box& box);
  void clear(std::size_t lane);
};

/// Of the hierarchy: boxes along the axes of the world around eight nodes or groups.
struct alignas(64) BoxNode {
  float lo[3][8], hi[3][8];
  std::int32_t child[8];  ///< A node, or ~group; 0: none.

  BoxNode();  ///< All lanes are empty.
};

/// One of a group.
struct BoxLane {
  const BoxGroup* group;
  std::size_t lane;
};

/// What is near one box among a group.
struct NearGroup {
  std::uint32_t box;    ///< Index of the moving box; set by nearBox().
  std::uint32_t group;  ///< Index of the group, fixed groups first; set by nearBox().
  std::uint32_t mask;   ///< Lanes of the group that are near.
  float gap[8];         ///< Not more than the distance less both reaches; negative where boxes overlap.
};

/// Which of the lanes in `mask` may be as near as `far` and the lane's own far_b[] together; fills n.mask and n.gap.
void nearInGroup(const BoxLane& a, const BoxGroup& b, std::uint32_t mask, float far, const float* far_b, NearGroup& n);

/// The boxes of a scene: the fixed ones below a hierarchy's root, node 0 (null: there are none), and the moving ones.
struct SceneBoxes {
  const BoxNode* nodes;
  const BoxGroup *fixed, *moving;
  std::size_t fixed_count, moving_count;  ///< Groups.
};

/// The same for moving box i and all groups, fixed ones first; masks[group] are the lanes asked for. far_of_moving: of
/// all moving objects; null: 0. Writes at most as many as there are groups to `near` and returns how many; `stack` has
/// room for all nodes.
std::size_t nearBox(const SceneBoxes& boxes, std::size_t i, const std::uint8_t* masks, float far,
                    const float* far_of_moving, std::int32_t* stack, NearGroup* near);

}  // namespace bocst::scene
