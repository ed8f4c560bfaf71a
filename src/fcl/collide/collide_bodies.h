// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "fcl/adapters/narrow_phase.h"
#include "fcl/collide/collide_query.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// collidePair() for a model, side A, and a shape (see isShape()).
template <typename S>
void collideShape(const CollideQuery<S>& q, tree::Tree& tree, const BroughtSolver<S>& solver);

/// The same for an fcl::OcTree. There is none where FCL was built without octomap.
template <typename S>
void collideOcTree(const CollideQuery<S>& q, tree::Tree& tree, const BroughtSolver<S>& solver);

}  // namespace bocst::fcl_adapter
