// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/clip.h"

#include <limits>

namespace bocst::oracle {

void OctantAccumulator::clear() {
  lo_.setConstant(std::numeric_limits<float>::infinity());
  hi_ = -lo_;
  area_.setZero();
  slab_ = true;
  count_ = 0;
}

void OctantAccumulator::add(const LocalPoint* corners, int count, const LocalPoint& lo, const LocalPoint& hi,
                            bool keep) {
  lo_ = lo_.cwiseMin(lo);
  hi_ = hi_.cwiseMax(hi);
  if (!keep) {
    slab_ = false;
    return;
  }
  if (count_ + 12 > corners_[0].size()) {
    for (auto& c : corners_) c.resize(2 * count_ + 240);
  }
  for (int i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) corners_[k][count_] = corners[i][static_cast<int>(k)];
    ++count_;
  }
  // One coordinate at a time: vectors would go through memory.
  float area[3] = {0, 0, 0};
  for (int i = 2; i < count; ++i) {
    const LocalPoint &a = corners[0], &b = corners[i - 1], &c = corners[i];
    const float u[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, v[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
    area[0] += u[1] * v[2] - u[2] * v[1];
    area[1] += u[2] * v[0] - u[0] * v[2];
    area[2] += u[0] * v[1] - u[1] * v[0];
  }
  // Neighbouring triangles need not agree on which side is out.
  const float same = area[0] * area_[0] + area[2] * area_[2] + area[1] * area_[1], sign = same < 0 ? -1.0f : 1.0f;
  for (int k = 0; k < 3; ++k) area_[k] += sign * area[k];
}

void OctantAccumulator::extremesAlong(const LocalPoint& normal, float& lo, float& hi) const {
  if (count_ == 0) return;
  const auto coordinate = [this](std::size_t k) {
    return Eigen::Map<const Eigen::ArrayXf>(corners_[k].data(), static_cast<Eigen::Index>(count_));
  };
  const auto along = coordinate(0) * normal[0] + coordinate(1) * normal[1] + coordinate(2) * normal[2];
  lo = std::min(lo, along.minCoeff());
  hi = std::max(hi, along.maxCoeff());
}

bounds::NodeBounds OctantAccumulator::bounds(const OctantAccumulator* const* parts, std::size_t count,
                                             const bounds::CellFrame& frame) {
  LocalPoint lo = parts[0]->lo_, hi = parts[0]->hi_, area = parts[0]->area_;
  bool slab = parts[0]->slab_;
  for (std::size_t i = 1; i < count; ++i) {
    lo = lo.cwiseMin(parts[i]->lo_);
    hi = hi.cwiseMax(parts[i]->hi_);
    slab = slab && parts[i]->slab_;
    area += area.dot(parts[i]->area_) < 0 ? LocalPoint(-parts[i]->area_) : parts[i]->area_;
  }
  bounds::NodeBounds b;
  constexpr double kMargin = 2 * kClipMargin;
  for (int k = 0; k < 3; ++k) frame.encodeBox(static_cast<std::size_t>(k), lo[k] - kMargin, hi[k] + kMargin, b);
  std::int8_t normal[3];
  if (!slab || !bounds::encodeNormal(area[0], area[1], area[2], normal)) return b;
  const LocalPoint n(normal[0], normal[1], normal[2], 0);
  float least = std::numeric_limits<float>::infinity(), most = -least;
  for (std::size_t i = 0; i < count; ++i) parts[i]->extremesAlong(n, least, most);
  // Corners are within half the margin on each axis; their sums in float: at most 8 roundings of values below
  // kMostNormalNorm1 * size.
  const double size = std::max(lo.head<3>().cwiseAbs().maxCoeff(), hi.head<3>().cwiseAbs().maxCoeff());
  const double round = 8 * 0x1p-24 * bounds::kMostNormalNorm1 * size + n.head<3>().lpNorm<1>() * kClipMargin;
  double middle = 0;
  for (std::size_t k = 0; k < 3; ++k) middle += normal[k] * frame.middle(k);
  frame.encodeSlab(normal, least - middle - round, most - middle + round, b);
  return b;
}

}  // namespace bocst::oracle
