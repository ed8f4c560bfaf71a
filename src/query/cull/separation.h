// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "geometry/volume.h"
#include "tree/outline.h"
#include "tree/support_table.h"

// Two surfaces whose convex hulls are apart, told without a walk: by a direction in which the one ends before the other
// begins.

namespace bocst::query {

/// True if two surfaces are surely apart by their supports. `b_in_a` places the lattice of b in that of a. Tries
/// directions about the line of the middles of their bounds, then closer about the best one so far, so it may miss one.
/// Where it does, `shallow` tells whether the hulls overlap so little that the surfaces are probably apart.
bool areSeparate(const tree::SupportTable& a, const tree::SupportTable& b, const SimilarityTransform& b_in_a,
                 bool& shallow);

/// What can be read of a surface without a lock.
struct OpenHull {
  const tree::SupportTable& supports;
  const tree::Outline& outline;  ///< Tells whether all was read of one surface.
};

/// What areSeparate() says of two hulls.
enum class Hulls {
  kUnknown,  ///< It was not asked, a surface changed meanwhile, or numbers were beyond the range of float.
  kApart,
  kClose,    ///< They are apart by no more than the rounding margin, or overlap by no more than that.
  kShallow,  ///< They may meet, but the surfaces are probably apart.
  kMeet      ///< They may meet.
};

/// As areSeparate(), without a lock: kApart if the two are surely farther apart than `margin`. Poses, and what is
/// allowed for their rounding, as for areFarApart(); see share/doc/rounding.md.
template <typename S>
Hulls hullsWithoutLock(const OpenHull& a, const S* X_WA, const OpenHull& b, const S* X_WB, double margin);

/// What one iteration evaluates: f(u) = u.t - h_a(u) - h_b(-R^T u) of eight directions u in a's frame, each h as
/// interpolated. Positive, beyond the rounding margin, means apart. For tests; chosen at run time for the machine's
/// instruction set.
struct EightSeparations {
  float u[3][8];  ///< in
  float value[8];
};
void evaluate(const tree::SupportTable& a, const tree::SupportTable& b, const SimilarityTransform& b_in_a,
              EightSeparations& eight);

}  // namespace bocst::query
