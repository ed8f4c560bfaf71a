// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/narrow_phase-inl.h"

template void bocst::fcl_room::withNarrowPhase<float>(const BroughtSolver<float>&, const fcl::CollisionRequest<float>&,
                                                      const std::function<void(const NarrowPhase<float>&)>&);
