// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>

#include <cstddef>
#include <cstdint>

namespace bocst::fcl_adapter {

/// hit[k] is 1 where fcl::collide says with the default request that b touches a at the pose X_AB[k], else 0. Poses are
/// rigid; those that PoseBoxes separate were left out.
template <typename S>
void collideRow(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                std::uint8_t* hit);

/// True if fcl::collide says with the default request that two models touch. Poses as above.
template <typename S>
bool touch(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB);

/// True if probes prove that they touch. A sixth of a walk's time; false says nothing.
template <typename S>
bool surelyTouch(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB);

}  // namespace bocst::fcl_adapter
