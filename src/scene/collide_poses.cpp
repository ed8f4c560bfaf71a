// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/collide_poses.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_row.h"
#include "scene/pool.h"

namespace bocst {
namespace {

/// Poses that a thread takes at a time: enough that taking them costs nothing, few enough to be shared out.
constexpr std::size_t kRow = 256;

template <typename S>
void checkPoses(const fcl::Transform3<S>* X_AB, std::size_t begin, std::size_t end) {
  for (std::size_t k = begin; k < end; ++k) {
    if (__builtin_expect(fcl_adapter::isSurelyRigid(X_AB[k]), 1)) continue;
    fcl_adapter::checkPose("collidePoses", ("pose " + std::to_string(k)).c_str(), X_AB[k]);
  }
}

}  // namespace

template <typename S>
void collidePoses(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                  std::uint8_t* hit, unsigned threads) {
  if (count == 0) return;
  if (X_AB == nullptr) throw std::invalid_argument("bocst::collidePoses: X_AB is null");
  if (hit == nullptr) throw std::invalid_argument("bocst::collidePoses: hit is null");
  const std::size_t rows = (count + kRow - 1) / kRow;
  const auto work = [&](std::size_t row) {
    const std::size_t begin = row * kRow, end = std::min(begin + kRow, count);
    checkPoses(X_AB, begin, end);
    fcl_adapter::collideRow(a, b, X_AB + begin, end - begin, hit + begin);
    return true;
  };
  scene::Pool(rows > 1 ? threads : 1).share(rows, work);
}

template void collidePoses(const Model<float>&, const Model<float>&, const fcl::Transform3<float>*, std::size_t,
                           std::uint8_t*, unsigned);
template void collidePoses(const Model<double>&, const Model<double>&, const fcl::Transform3<double>*, std::size_t,
                           std::uint8_t*, unsigned);

}  // namespace bocst
