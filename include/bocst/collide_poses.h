// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/model.h>
#include <fcl/common/types.h>

#include <cstddef>
#include <cstdint>

namespace bocst {

/// Which of many poses of one pair collide? hit[k] is set to 1 where b, at the pose X_AB[k], collides with a, else to
/// 0, for 0 <= k < count.
///
/// **Poses.** X_AB[k] is the pose of b in the frame of a: it takes points of b to where they are in a's frame, with
/// translations in the length unit of the meshes. One after the other, as a Scene takes them whose fixed object is a,
/// at the identity, and whose moving object is b. From poses in the world, X_AB = X_WA.inverse() * X_WB.
///
/// **Verdicts** are those of fcl::collide(&a, Identity, &b, X_AB[k]) with the default request; margins, solids,
/// conservative answers and occupancy count as there. They do not depend on threads, nor on what is resident. Poses
/// whose boxes are apart cost some nanoseconds each.
///
/// `threads` share the poses, the calling one included; 0: as many as the machine runs at once. They are started by
/// this call, so more than one pays for some thousand poses.
///
/// Thread rule: as collide(); models may be asked, pruned and deformed at the same time. Each pose sees a mesh from
/// before or after a change.
/// @throws std::invalid_argument for a null array, and for a pose that is not rigid, of which it names the first. What
/// is in hit[] then means nothing.
template <typename S>
BOCST_EXPORT void collidePoses(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                               std::uint8_t* hit, unsigned threads = 1);

/// How the 16 numbers of a 4x4 matrix lie in memory: column after column, as Eigen has them, or row after row, as
/// arrays in C and NumPy.
enum class MatrixOrder { kColumns, kRows };

/// The same for matrices that are bare numbers, of no alignment but that of S: X_AB[16 * k] is the first of pose k.
/// They are read where they are.
/// @throws std::invalid_argument as above, and for a matrix whose last row is not 0 0 0 1.
template <typename S>
BOCST_EXPORT void collidePoses(const Model<S>& a, const Model<S>& b, const S* X_AB, MatrixOrder order,
                               std::size_t count, std::uint8_t* hit, unsigned threads = 1);

extern template void collidePoses(const Model<float>&, const Model<float>&, const fcl::Transform3<float>*, std::size_t,
                                  std::uint8_t*, unsigned);
extern template void collidePoses(const Model<double>&, const Model<double>&, const fcl::Transform3<double>*,
                                  std::size_t, std::uint8_t*, unsigned);
extern template void collidePoses(const Model<float>&, const Model<float>&, const float*, MatrixOrder, std::size_t,
                                  std::uint8_t*, unsigned);
extern template void collidePoses(const Model<double>&, const Model<double>&, const double*, MatrixOrder, std::size_t,
                                  std::uint8_t*, unsigned);

}  // namespace bocst
