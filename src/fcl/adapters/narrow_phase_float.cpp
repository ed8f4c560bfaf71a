// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/adapters/narrow_phase-inl.h"

template void bocst::fcl_adapter::withNarrowPhase<float>(const BroughtSolver<float>&,
                                                         const fcl::CollisionRequest<float>&,
                                                         const std::function<void(const NarrowPhase<float>&)>&);
