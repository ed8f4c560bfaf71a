// SPDX-License-Identifier: BSD-3-Clause
#include "query/cull/crossing.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/cull/crossing.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cmath>

#include "query/cull/probe_grid.h"
#include "simd/vectors-inl.h"

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

// True if a probe is in a marked cell, or, where that counts, beyond the grid.
HWY_INLINE bool anyIn(const ProbeGrid& grid, const std::uint32_t* marked, bool beyond_counts) {
  const D d;
  using Di = hn::RebindToSigned<D>;
  const Di di;
  const V side = hn::Set(d, static_cast<float>(1 << grid.bits));
  const auto bits = hn::Set(di, grid.bits);
  auto found = hn::Zero(di);
  for (std::size_t i = 0; i < Interior::kProbes; i += hn::Lanes(d)) {
    const Vec3 p = load(*grid.probes, i);
    V at[3];
    M in_grid = hn::Eq(p.x, p.x);
    for (std::size_t k = 0; k < 3; ++k) {
      const V y = hn::MulAdd(hn::Set(d, grid.to_cells[k][1]), p.y, hn::Set(d, grid.shift[k]));
      at[k] = hn::MulAdd(hn::Set(d, grid.to_cells[k][0]), p.x, hn::MulAdd(hn::Set(d, grid.to_cells[k][2]), p.z, y));
      in_grid = hn::And(in_grid, hn::And(hn::Ge(at[k], hn::Zero(d)), hn::Lt(at[k], side)));
    }
    if (beyond_counts && !hn::AllTrue(d, in_grid)) return true;
    if (hn::AllFalse(d, in_grid)) continue;
    const auto cell = [&](std::size_t k) { return hn::ConvertTo(di, hn::IfThenElseZero(in_grid, at[k])); };
    const auto number = hn::Or(hn::Shl(hn::Or(hn::Shl(cell(2), bits), cell(1)), bits), cell(0));
    const auto bit =
        hn::IfThenElseZero(hn::RebindMask(di, in_grid), hn::Shl(hn::Set(di, 1), hn::And(number, hn::Set(di, 31))));
    const auto word = hn::ShiftRight<5>(number);
    found = hn::Or(found, hn::And(hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(marked), word), bit));
  }
  return !hn::AllTrue(di, hn::Eq(found, hn::Zero(di)));
}

bool EntersAndLeaves(const ProbeGrid& grid) {
  return anyIn(grid, grid.inside, false) && anyIn(grid, grid.outside, true);
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(EntersAndLeaves);

namespace {

/// True if probes prove that a surface crosses that of `grid`, in whose lattice units they are at M * probe + t. They
/// may be off by `off` units; the rows of M are `scale` long.
bool proves(const Interior& grid, const float (&probes)[3][Interior::kProbes], const double (&M)[3][3],
            const double (&t)[3], double scale, double off) {
  if (grid.bits == 0) return false;
  ProbeGrid g;
  g.probes = &probes;
  g.inside = grid.inside.data();
  g.outside = grid.outside.data();
  g.bits = grid.bits;
  // Probes are no farther than this from the middle of their root cube. In float, a probe, an entry, a product and
  // three sums are rounded: 6 u, of the shift 4.
  constexpr double kReach = 0.87 * (1 << lattice::kBits), kRounding = 16 * 0x1p-24;
  for (int k = 0; k < 3; ++k) {
    const double per_unit = grid.cells_per_unit[k], shift = (t[k] - grid.low[k]) * per_unit;
    const double off_in_cells = (off + kRounding * scale * kReach) * per_unit + kRounding * std::abs(shift);
    if (!(off_in_cells < Interior::kAllowed)) return false;
    for (int j = 0; j < 3; ++j) g.to_cells[k][j] = static_cast<float>(M[k][j] * per_unit);
    g.shift[k] = static_cast<float>(shift);
  }
  return HWY_DYNAMIC_DISPATCH(EntersAndLeaves)(g);
}

}  // namespace

// Spelled out: Eigen's products are calls here.
bool surelyCross(const Interior& a, const Interior& b, const SimilarityTransform& b_in_a) {
  if (a.bits == 0 && b.bits == 0) return false;
  // Probes are counted from the middles of the root cubes.
  constexpr double kMiddle = lattice::kMiddle;
  const double scale = b_in_a.scale, per_scale = 1 / scale;
  double to_a[3][3], to_b[3][3], b_at[3], a_at[3], way = 0;
  for (int k = 0; k < 3; ++k) {
    b_at[k] = b_in_a.translation[k];
    for (int j = 0; j < 3; ++j) {
      to_a[k][j] = scale * b_in_a.rotation(k, j);
      to_b[k][j] = per_scale * b_in_a.rotation(j, k);
      b_at[k] += to_a[k][j] * kMiddle;
    }
    way += std::abs(kMiddle - b_at[k]);
  }
  if (proves(a, b.probes, to_a, b_at, scale, b_in_a.tolerance)) return true;
  // The transposed rotation is its inverse but for its error, over the way between the middles and beyond.
  for (int k = 0; k < 3; ++k) {
    a_at[k] = kMiddle;
    for (int j = 0; j < 3; ++j) a_at[k] += to_b[k][j] * (kMiddle - b_at[j]);
  }
  const double off = b_in_a.tolerance + 4 * b_in_a.orthogonality_error * (way + (1 << lattice::kBits));
  return proves(b, a.probes, to_b, a_at, per_scale, off * per_scale);
}

}  // namespace bocst::query
#endif
