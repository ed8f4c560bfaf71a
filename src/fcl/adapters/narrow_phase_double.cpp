// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/adapters/narrow_phase-inl.h"

template void bocst::fcl_adapter::withNarrowPhase<double>(const BroughtSolver<double>&,
                                                          const fcl::CollisionRequest<double>&,
                                                          const std::function<void(const NarrowPhase<double>&)>&);
