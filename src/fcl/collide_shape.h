// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "fcl/narrow_phase.h"
#include "fcl/question.h"
#include "fcl/shape_body.h"
#include "tree/tree.h"

namespace bocst::fcl_room {

/// collidePair() for a model and a shape (see isShape()), which is the first geometry when `swapped`.
template <typename S>
void collideShape(const Question<S>& q, tree::Tree& tree, bool swapped, const BroughtSolver<S>& solver);

}  // namespace bocst::fcl_room
