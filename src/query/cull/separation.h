// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"
#include "tree/support_table.h"

// Two surfaces whose convex hulls are apart, told without a walk: by a direction in which the one ends before the other
// begins.

namespace bocst::query {

/// Points of the support tables that the last search interpolated between: exact supports there would make the next
/// search sharper.
struct NearDirections {
  bool shallow = false;  ///< The hulls overlap so little that the surfaces are probably apart.
  int lanes = 0;         ///< 8, or 0 if there are none.
  std::int32_t of_a[3][8], of_b[3][8];
};

/// Are two surfaces surely apart by their supports? `b_in_a` places the lattice of b in that of a. Tries directions
/// about the line of the middles of their bounds, then ever closer about the best direction so far, so it may miss one;
/// what it looked at last is then in `near`.
bool areSeparate(const tree::SupportTable& a, const tree::SupportTable& b, const SimilarityTransform& b_in_a,
                 NearDirections& near);

/// What one iteration evaluates: f(u) = u.t - h_a(u) - h_b(-R^T u) of eight directions u in a's frame, each h as
/// interpolated. Positive, beyond the rounding margin, means apart. For tests; chosen at run time for the machine's
/// instruction set.
struct EightSeparations {
  float u[3][8];  ///< in
  float value[8];
  NearDirections near;
};
void evaluate(const tree::SupportTable& a, const tree::SupportTable& b, const SimilarityTransform& b_in_a,
              EightSeparations& eight);

}  // namespace bocst::query
