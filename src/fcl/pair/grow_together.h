// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// Two models and their poses.
template <typename S>
struct PosedPair {
  const Model<S>* a;
  fcl::Transform3<S> X_WA;
  const Model<S>* b;
  fcl::Transform3<S> X_WB;
};

/// True if growTogether() is worth it: both answer conservatively without a budget, and one asks a slow oracle.
template <typename S>
bool growsTogether(const Model<S>& a, const Model<S>& b);

enum class Spheres : std::uint8_t { kApart, kMeet, kUnknown };

/// Grows what fcl::collide with the default request asks for, of pairs of models that grow together; what all pairs
/// need at a time is one batch, so a device is asked as often as for the pair that needs the most. Returns for each
/// pair whether the spheres of any leaves meet; unknown where one model is too large for the other. Poses are rigid.
/// The result is good until the thread's next call.
template <typename S>
const std::vector<Spheres>& growTogether(const std::vector<PosedPair<S>>& pairs);

/// True if the second tree is side A of a walk. Conservative verdicts must not depend on the argument order, so there
/// the walk has an order of its own: by address only of two conservative models at equal poses, so that what a query
/// grows does not depend on where models happen to lie.
template <typename S>
bool walksTurned(const tree::Tree& tree1, const fcl::Transform3<S>& X_W1, const tree::Tree& tree2,
                 const fcl::Transform3<S>& X_W2) {
  if (!tree1.conservative() && !tree2.conservative()) return false;
  const S *x1 = X_W1.matrix().data(), *x2 = X_W2.matrix().data();
  const auto differ = std::mismatch(x1, x1 + 16, x2);
  if (differ.first != x1 + 16) return *differ.second < *differ.first;
  if (tree1.conservative() != tree2.conservative()) return tree2.conservative();
  return std::less<const tree::Tree*>()(&tree2, &tree1);
}

}  // namespace bocst::fcl_adapter
