// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/clip.h"

#include <limits>

namespace bocst::oracle {

void OctantAccumulator::clear() {
  lo_.setConstant(std::numeric_limits<double>::infinity());
  hi_ = -lo_;
  area_.setZero();
  slab_ = true;
  corners_.clear();
}

void OctantAccumulator::add(const Eigen::Vector3d* corners, int count, bool keep) {
  const Eigen::Vector3d& first = corners[0];
  lo_ = lo_.cwiseMin(first);
  hi_ = hi_.cwiseMax(first);
  Eigen::Vector3d area = Eigen::Vector3d::Zero();
  for (int i = 1; i < count; ++i) {
    lo_ = lo_.cwiseMin(corners[i]);
    hi_ = hi_.cwiseMax(corners[i]);
    if (i >= 2) area += (corners[i - 1] - first).cross(corners[i] - first);
  }
  if (!keep) {
    slab_ = false;
    return;
  }
  // Neighbouring triangles need not agree on which side is out.
  if (area.dot(area_) < 0) {
    area_ -= area;
  } else {
    area_ += area;
  }
  for (int i = 0; i < count; ++i) corners_.push_back(corners[i].cast<float>());
}

void OctantAccumulator::addBox(const Eigen::Vector3d& lo, const Eigen::Vector3d& hi) {
  lo_ = lo_.cwiseMin(lo);
  hi_ = hi_.cwiseMax(hi);
  slab_ = false;
}

void OctantAccumulator::merge(const OctantAccumulator& other) {
  lo_ = lo_.cwiseMin(other.lo_);
  hi_ = hi_.cwiseMax(other.hi_);
  slab_ = slab_ && other.slab_;
  if (other.area_.dot(area_) < 0) {
    area_ -= other.area_;
  } else {
    area_ += other.area_;
  }
  corners_.insert(corners_.end(), other.corners_.begin(), other.corners_.end());
}

CellBounds OctantAccumulator::bounds(const Eigen::Vector3d& center, double side) const {
  CellBounds b;
  const double scale = 255 / side, margin = 2 * kClipMargin;
  for (int k = 0; k < 3; ++k) {
    const double corner = center[k] - side / 2;
    b.lo[k] = static_cast<std::uint8_t>(std::clamp(std::floor((lo_[k] - margin - corner) * scale), 0.0, 255.0));
    b.hi[k] = static_cast<std::uint8_t>(std::clamp(std::ceil((hi_[k] + margin - corner) * scale), 0.0, 255.0));
  }
  const double length = area_.norm();
  if (!slab_ || !(length > 0) || corners_.empty()) return b;
  Eigen::Vector3d n;
  for (int k = 0; k < 3; ++k) n[k] = std::round(area_[k] / length * 127);
  const Eigen::Vector3f nf = n.cast<float>(), cf = center.cast<float>();
  float lo = std::numeric_limits<float>::infinity(), hi = -lo;
  for (const Eigen::Vector3f& p : corners_) {
    const float t = nf.dot(p - cf);
    lo = std::min(lo, t);
    hi = std::max(hi, t);
  }
  // Corners and sums in float: at most 8 roundings of values below 3 * 127 * size.
  const double size = std::max({(lo_ - center).lpNorm<Eigen::Infinity>(), (hi_ - center).lpNorm<Eigen::Infinity>(),
                                center.lpNorm<Eigen::Infinity>()}) *
                      2;
  const double round = 8 * 0x1p-24 * 3 * 127 * size + 127 * 2 * margin;
  const double below = (lo - round) / side, above = (hi + round) / side;
  const double middle = std::round((below + above) / 2);
  const double half = std::ceil(2 * std::max(above - middle, middle - below));
  if (half > 255 || std::abs(middle) > 127) return b;
  for (int k = 0; k < 3; ++k) b.normal[k] = static_cast<std::int8_t>(n[k]);
  b.slab_center = static_cast<std::int8_t>(middle);
  b.slab_half = static_cast<std::uint8_t>(half);
  return b;
}

}  // namespace bocst::oracle
