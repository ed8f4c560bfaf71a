// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "tree/tree.h"

namespace bocst::test {

/// Triangles in the leaves of a tree whose queries have ended, and how many of them are in packed leaves.
struct PackedShare {
  std::size_t packed = 0, all = 0;
};

inline PackedShare packedShareOf(const tree::Tree& tree) {
  PackedShare share;
  std::vector<tree::NodeRef> stack{tree::NodeRef()};
  while (!stack.empty()) {
    const tree::ChildRef ref = tree.childRef(stack.back());
    stack.pop_back();
    if (ref.tag() == tree::ChildRef::kBlock) {
      for (int o = 0; o < 8; ++o) {
        if ((tree.block(ref.index()).grey >> o & 1) != 0) stack.push_back(tree::NodeRef::octant(ref.index(), o));
      }
    } else if (ref.tag() == tree::ChildRef::kShortList) {
      const std::size_t count = tree.list(ref).count;
      share.all += count;
      tree::PackedTriangles corners;
      if (!tree.lists().packed(ref.index(), corners)) continue;
      EXPECT_EQ(corners.count, count);
      share.packed += count;
    }
  }
  return share;
}

}  // namespace bocst::test
