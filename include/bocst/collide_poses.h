// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/model.h>
#include <fcl/common/types.h>

#include <cstddef>
#include <cstdint>

namespace bocst {

/// Checks one pair of models for collision at many poses. Sets hit[k] to 1 if b at the pose X_AB[k] collides with a,
/// otherwise to 0, for 0 <= k < count.
///
/// **Poses.** X_AB[k] is the pose of b in the frame of a: p_A = X_AB[k] * p_B. Translations are in the length unit of
/// the meshes. The array is the same as for the states of a Scene in which a is fixed at the identity pose and b is the
/// only moving object. From poses in the world frame: X_AB = X_WA.inverse() * X_WB.
///
/// **Verdicts** equal those of fcl::collide(&a, Identity, &b, X_AB[k]) with the default request, including margins,
/// solids, conservative answers and occupancy. They do not depend on `threads` or on which nodes are resident. A pose
/// at which the bounding boxes are apart takes some nanoseconds.
///
/// `threads`: number of threads that share the poses, including the calling thread. 0: one for every
/// 4096 poses, at most one per hardware thread; fewer poses do not pay for threads, which each call starts. Pass 1 if
/// your own threads call this at the same time.
///
/// Thread rule: as collide(); the models may be queried, pruned and deformed at the same time. Each pose sees a mesh
/// either before or after a change.
/// @throws std::invalid_argument for a null array, and for a pose that is not rigid (the message names the first one),
/// unless a model is empty. The contents of hit[] are then unspecified.
template <typename S>
BOCST_EXPORT void collidePoses(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                               std::uint8_t* hit, unsigned threads = 0);

/// The order of the 16 numbers of a 4x4 matrix in memory: column by column, as in Eigen (kColumns), or row by row, as
/// in C and NumPy arrays (kRows).
enum class MatrixOrder { kColumns, kRows };

/// The same for 4x4 matrices as plain numbers: X_AB[16 * k] is the first number of pose k. The array needs no alignment
/// other than that of S. It is not copied.
/// @throws std::invalid_argument as above, and for a matrix whose last row is not 0 0 0 1.
template <typename S>
BOCST_EXPORT void collidePoses(const Model<S>& a, const Model<S>& b, const S* X_AB, MatrixOrder order,
                               std::size_t count, std::uint8_t* hit, unsigned threads = 0);

extern template void collidePoses(const Model<float>&, const Model<float>&, const fcl::Transform3<float>*, std::size_t,
                                  std::uint8_t*, unsigned);
extern template void collidePoses(const Model<double>&, const Model<double>&, const fcl::Transform3<double>*,
                                  std::size_t, std::uint8_t*, unsigned);
extern template void collidePoses(const Model<float>&, const Model<float>&, const float*, MatrixOrder, std::size_t,
                                  std::uint8_t*, unsigned);
extern template void collidePoses(const Model<double>&, const Model<double>&, const double*, MatrixOrder, std::size_t,
                                  std::uint8_t*, unsigned);

}  // namespace bocst
