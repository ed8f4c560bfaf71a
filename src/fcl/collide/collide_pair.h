// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>

#include <optional>

#include "fcl/adapters/narrow_phase.h"

namespace bocst::fcl_adapter {

/// The collision query for a pair of which at least one side is a Model<S>. Same meaning as bocst::collide.
/// `solver` is the caller's own or none; `margin` takes the place of the models' own (a reference, as a copy of what
/// was just written in part stalls).
/// @throws std::invalid_argument when the partner is not supported.
template <typename S>
std::size_t collidePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const BroughtSolver<S>& solver, const fcl::CollisionRequest<S>& request,
                        fcl::CollisionResult<S>& result, const std::optional<double>& margin = std::nullopt);

}  // namespace bocst::fcl_adapter
