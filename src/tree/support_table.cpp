// SPDX-License-Identifier: BSD-3-Clause
#include "tree/support_table.h"

#include <cmath>

namespace bocst::tree {
namespace {

// Adds the rounding to float, also of the smallest numbers, and that of the sums in double.
float roundedUp(double x) { return static_cast<float>(x + 0x1p-23 * std::abs(x) + 1e-40); }

struct Directions {
  double entries[SupportTable::kCount][3] = {};

  constexpr Directions() {
    constexpr int kRow = SupportTable::kRow;
    for (int number = 0; number < SupportTable::kCount; ++number) {
      const int j = number % kRow, i = number / kRow % kRow, face = number / (kRow * kRow), k = face / 2;
      entries[number][k] = face % 2 == 0 ? 1 : -1;
      entries[number][(k + 1) % 3] = 2.0 * i / SupportTable::kCells - 1;
      entries[number][(k + 2) % 3] = 2.0 * j / SupportTable::kCells - 1;
    }
  }
};
constexpr Directions kDirections;

}  // namespace

Eigen::Vector3d SupportTable::direction(int number) { return Eigen::Vector3d(kDirections.entries[number]); }

// Stores release, so that Outline::read() sees that a reader met one of them.
void SupportTable::start(const Eigen::AlignedBox3d& box, const lattice::Lattice& lattice) {
  const Eigen::Vector3d root = Eigen::Vector3d::Constant(lattice::kMiddle);
  const Eigen::Vector3d center = box.center() - root, half = box.sizes() / 2;
  const Eigen::Vector3d middle = lattice.origin() + lattice.unit() * root;
  for (int k = 0; k < 3; ++k) {
    center_[static_cast<std::size_t>(k)].store(static_cast<float>(center[k]), std::memory_order_release);
    middle_[static_cast<std::size_t>(k)].store(static_cast<float>(middle[k]), std::memory_order_release);
  }
  unit_.store(static_cast<float>(lattice.unit()), std::memory_order_release);
  inner_radius_.store(static_cast<float>(half.minCoeff()), std::memory_order_release);
  for (int n = 0; n < kCount; ++n) {
    const Eigen::Vector3d d = direction(n);
    const auto i = static_cast<std::size_t>(n);
    // The terms may cancel, their rounding does not.
    const double margin = 1e-9 * d.cwiseAbs().dot(center.cwiseAbs() + half);
    values_[i].store(roundedUp(d.dot(center) + d.cwiseAbs().dot(half) + margin), std::memory_order_release);
  }
}

void SupportTable::lower(int number, double value) {
  const auto i = static_cast<std::size_t>(number);
  const float rounded = roundedUp(value);
  float known = values_[i].load(std::memory_order_relaxed);
  while (rounded < known && !values_[i].compare_exchange_weak(known, rounded, std::memory_order_relaxed)) {
  }
  const Eigen::Vector3f d = direction(number).cast<float>();
  const float radius = (rounded - d.dot(Eigen::Vector3f(center(0), center(1), center(2)))) / d.norm();
  if (radius < innerRadius()) inner_radius_.store(radius, std::memory_order_relaxed);
}

}  // namespace bocst::tree
