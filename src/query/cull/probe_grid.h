// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "mesh/interior.h"

namespace bocst::query {

/// Probes of one surface over the grid of another; see Interior. A probe's position in cells is to_cells * probe +
/// shift.
struct ProbeGrid {
  const float (*probes)[3][Interior::kProbes];
  const std::uint32_t *inside, *outside;
  int bits;
  float to_cells[3][3], shift[3];
};

}  // namespace bocst::query
