// SPDX-License-Identifier: BSD-3-Clause
#include "tree/packed_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

namespace bocst::tree {

namespace {

constexpr double kMost = 65535;

}  // namespace

PackedTriangles::PackedTriangles(const std::uint32_t* words, std::size_t count_) : count(count_) {
  std::memcpy(origin, words, sizeof(origin));
  std::memcpy(&step, words + 3, sizeof(step));
  steps = reinterpret_cast<const std::uint16_t*>(words + kHeader);
}

void PackedTriangles::pack(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count,
                           std::uint32_t* words) {
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < count; ++i) {
    for (int k = 0; k < 3; ++k) box.extend(surface.corner(ids[i], k));
  }
  const Eigen::Vector3d origin = box.min().array().floor();
  const double extent = (box.max() - origin).maxCoeff();
  const double step = std::exp2(std::ceil(std::log2(std::max(extent, 0x1p-8) / kMost)));

  for (std::size_t k = 0; k < 3; ++k) {
    const auto o = static_cast<float>(origin[k]);
    std::memcpy(words + k, &o, sizeof(o));
  }
  const auto s = static_cast<float>(step);
  std::memcpy(words + 3, &s, sizeof(s));
  auto* const steps = reinterpret_cast<char*>(words + kHeader);
  std::memset(steps, 0, (PackedTriangles::words(count) - kHeader) * sizeof(*words));
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3d at = (surface.corner(ids[i], static_cast<int>(k)) - origin) / step;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto q = static_cast<std::uint16_t>(std::clamp(std::round(at[c]), 0.0, kMost));
        std::memcpy(steps + ((3 * k + c) * count + i) * sizeof(q), &q, sizeof(q));
      }
    }
  }
}

}  // namespace bocst::tree
