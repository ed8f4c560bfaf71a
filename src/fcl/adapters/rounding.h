// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <limits>

namespace bocst::fcl_adapter {

/// What FCL's own computations in S (R q + t, tests of triangles, fitted volumes) may be off by, for coordinates up to
/// `magnitude`; in the length unit of `magnitude`.
template <typename S>
constexpr double roundingOf(double magnitude) {
  return 32 * static_cast<double>(std::numeric_limits<S>::epsilon()) * magnitude;
}

}  // namespace bocst::fcl_adapter
