// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/libfcl.h"

#include <dlfcn.h>
#include <fcl/narrowphase/detail/gjk_solver_indep.h>
#include <fcl/narrowphase/detail/gjk_solver_libccd.h>

#include <cstring>
#include <stdexcept>
#include <string>

// Names by the C++ ABI of Linux (Itanium): what `nm -D libfcl.so` prints.
#define BOCST_COLLIDE(solver)                                                                        \
  "_ZN3fcl7collideIdNS_6detail" solver "IdEEEE" BOCST_SIZE                                           \
  "PKNS_17CollisionGeometryIT_EERKN5Eigen9TransformIS5_Li3ELi1ELi0EEES8_SD_PKT0_RKNS_16CollisionReq" \
  "uestIS5_EERNS_15CollisionResultIS5_EE"
#if __SIZEOF_SIZE_T__ == 8
#define BOCST_SIZE "m"
#else
#define BOCST_SIZE "j"
#endif

namespace bocst::fcl_adapter::libfcl {
namespace {

constexpr const char* kContinuousMotions =
    "_ZN3fcl17continuousCollideIdEET_PKNS_17CollisionGeometryIS1_EEPKNS_10MotionBaseIS1_EES5_S9_RKNS_26Continuous"
    "CollisionRequestIS1_EERNS_25ContinuousCollisionResultIS1_EE";
constexpr const char* kContinuousPoses =
    "_ZN3fcl17continuousCollideIdEET_PKNS_17CollisionGeometryIS1_EERKN5Eigen9TransformIS1_Li3ELi1ELi0EEESA_S5_SA_SA_"
    "RKNS_26ContinuousCollisionRequestIS1_EERNS_25ContinuousCollisionResultIS1_EE";

template <typename Solver>
const char* collideName();
template <>
const char* collideName<fcl::detail::GJKSolver_libccd<double>>() {
  return BOCST_COLLIDE("16GJKSolver_libccd");
}
template <>
const char* collideName<fcl::detail::GJKSolver_indep<double>>() {
  return BOCST_COLLIDE("15GJKSolver_indep");
}

/// The function of this name in libfcl, whatever comes before libfcl in the order in which names are searched.
template <typename F>
F* find(const char* name) {
  static void* const library = dlopen(BOCST_LIBFCL, RTLD_LAZY | RTLD_NOLOAD);
  void* const address = library != nullptr ? dlsym(library, name) : nullptr;
  if (address == nullptr) {
    throw std::runtime_error(std::string("bocst: FCL's own queries need " BOCST_LIBFCL
                                         " in the process, as a shared library that exports ") +
                             name);
  }
  F* function = nullptr;
  static_assert(sizeof function == sizeof address, "function pointers are addresses");
  std::memcpy(&function, &address, sizeof address);
  return function;
}

}  // namespace

template <typename Solver>
std::size_t collide(const fcl::CollisionGeometry<double>* o1, const fcl::Transform3<double>& X_W1,
                    const fcl::CollisionGeometry<double>* o2, const fcl::Transform3<double>& X_W2, const Solver* solver,
                    const fcl::CollisionRequest<double>& request, fcl::CollisionResult<double>& result) {
  static auto* const original = find<decltype(collide<Solver>)>(collideName<Solver>());
  return original(o1, X_W1, o2, X_W2, solver, request, result);
}
template std::size_t collide(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                             const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                             const fcl::detail::GJKSolver_libccd<double>*, const fcl::CollisionRequest<double>&,
                             fcl::CollisionResult<double>&);
template std::size_t collide(const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                             const fcl::CollisionGeometry<double>*, const fcl::Transform3<double>&,
                             const fcl::detail::GJKSolver_indep<double>*, const fcl::CollisionRequest<double>&,
                             fcl::CollisionResult<double>&);

double continuousCollide(const fcl::CollisionGeometry<double>* o1, const fcl::MotionBase<double>* motion1,
                         const fcl::CollisionGeometry<double>* o2, const fcl::MotionBase<double>* motion2,
                         const fcl::ContinuousCollisionRequest<double>& request,
                         fcl::ContinuousCollisionResult<double>& result) {
  using Function = double(const fcl::CollisionGeometry<double>*, const fcl::MotionBase<double>*,
                          const fcl::CollisionGeometry<double>*, const fcl::MotionBase<double>*,
                          const fcl::ContinuousCollisionRequest<double>&, fcl::ContinuousCollisionResult<double>&);
  static auto* const original = find<Function>(kContinuousMotions);
  return original(o1, motion1, o2, motion2, request, result);
}

double continuousCollide(const fcl::CollisionGeometry<double>* o1, const fcl::Transform3<double>& X_W1_begin,
                         const fcl::Transform3<double>& X_W1_end, const fcl::CollisionGeometry<double>* o2,
                         const fcl::Transform3<double>& X_W2_begin, const fcl::Transform3<double>& X_W2_end,
                         const fcl::ContinuousCollisionRequest<double>& request,
                         fcl::ContinuousCollisionResult<double>& result) {
  using Pose = const fcl::Transform3<double>&;
  using Function =
      double(const fcl::CollisionGeometry<double>*, Pose, Pose, const fcl::CollisionGeometry<double>*, Pose, Pose,
             const fcl::ContinuousCollisionRequest<double>&, fcl::ContinuousCollisionResult<double>&);
  static auto* const original = find<Function>(kContinuousPoses);
  return original(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request, result);
}

}  // namespace bocst::fcl_adapter::libfcl
