// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/plugin/libfcl.h"

#include <dlfcn.h>
#include <fcl/narrowphase/detail/gjk_solver_indep.h>
#include <fcl/narrowphase/detail/gjk_solver_libccd.h>

#include <atomic>
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

#define BOCST_ADVANCE(solver)                                                                              \
  "_ZN3fcl6detail40continuousCollideConservativeAdvancementINS0_" solver                                   \
  "IdEEEENT_1SEPKNS_17CollisionGeometryIS5_EEPKNS_10MotionBaseIS5_EES9_SD_PKS4_RKNS_26ContinuousCollision" \
  "RequestIS5_EERNS_25ContinuousCollisionResultIS5_EE"

namespace bocst::fcl_adapter::libfcl {
namespace {

using Geometry = fcl::CollisionGeometry<double>;
using Motion = fcl::MotionBase<double>;
using Pose = fcl::Transform3<double>;
using Request = fcl::ContinuousCollisionRequest<double>;
using Result = fcl::ContinuousCollisionResult<double>;
using Libccd = fcl::detail::GJKSolver_libccd<double>;
using Indep = fcl::detail::GJKSolver_indep<double>;

// Looked up when this library is loaded, by the thread that loads it: later, a look-up would wait for any thread that
// loads a library, which may itself wait for a query. A query by an initialiser before that looks it up itself.
class Function {
 public:
  constexpr explicit Function(const char* name) : name_(name) {}

  bool resolve() {
    void* const address = find();
    if (address != nullptr) address_.store(address, std::memory_order_release);
    return address != nullptr;
  }

  bool isFoundFirst() {
    const void* const found = dlsym(RTLD_DEFAULT, name_);
    return found != nullptr && found == address_.load(std::memory_order_acquire);
  }

  template <typename F>
  F* get() {
    if (address_.load(std::memory_order_acquire) == nullptr && !resolve()) {
      throw std::runtime_error(
          std::string("bocst: FCL's own queries need libfcl in the process, as a shared library that hides its tables "
                      "(-fvisibility=hidden, as FCL's own build does) and exports ") +
          name_);
    }
    void* const address = address_.load(std::memory_order_acquire);
    F* function = nullptr;
    static_assert(sizeof function == sizeof address, "function pointers are addresses");
    std::memcpy(&function, &address, sizeof address);
    return function;
  }

 private:
  // In libfcl, whatever comes before it in the order in which names are searched; under another name than it had when
  // this was built, in what comes after this library.
  void* find() const {
    void* const library = dlopen(BOCST_LIBFCL, RTLD_LAZY | RTLD_NOLOAD);
    // A table that can be seen is shared with this library, whose entries would call each other.
    if (dlsym(library != nullptr ? library : RTLD_NEXT, kTable) != nullptr) return nullptr;
    void* const address = library != nullptr ? dlsym(library, name_) : nullptr;
    return address != nullptr ? address : dlsym(RTLD_NEXT, name_);
  }

  static constexpr const char* kTable =
      "_ZZN3fcl29getCollisionFunctionLookTableINS_6detail16GJKSolver_libccdIdEEEERNS1_23CollisionFunctionMatrixIT_"
      "EEvE5table";

  const char* const name_;
  std::atomic<void*> address_{nullptr};
};

template <typename Solver>
Function collide_function{nullptr};
template <>
Function collide_function<Libccd>{BOCST_COLLIDE("16GJKSolver_libccd")};
template <>
Function collide_function<Indep>{BOCST_COLLIDE("15GJKSolver_indep")};
template <typename Solver>
Function advancement_function{nullptr};
template <>
Function advancement_function<Libccd>{BOCST_ADVANCE("16GJKSolver_libccd")};
template <>
Function advancement_function<Indep>{BOCST_ADVANCE("15GJKSolver_indep")};
Function motions_function(
    "_ZN3fcl17continuousCollideIdEET_PKNS_17CollisionGeometryIS1_EEPKNS_10MotionBaseIS1_EES5_S9_RKNS_26Continuous"
    "CollisionRequestIS1_EERNS_25ContinuousCollisionResultIS1_EE");
Function poses_function(
    "_ZN3fcl17continuousCollideIdEET_PKNS_17CollisionGeometryIS1_EERKN5Eigen9TransformIS1_Li3ELi1ELi0EEESA_S5_SA_SA_"
    "RKNS_26ContinuousCollisionRequestIS1_EERNS_25ContinuousCollisionResultIS1_EE");

[[maybe_unused]] const bool all_resolved = [] {
  bool all = true;
  for (Function* function : {&collide_function<Libccd>, &collide_function<Indep>, &advancement_function<Libccd>,
                             &advancement_function<Indep>, &motions_function, &poses_function}) {
    all &= function->resolve();
  }
  return all;
}();

}  // namespace

bool isFoundFirst() { return collide_function<Libccd>.isFoundFirst() || collide_function<Indep>.isFoundFirst(); }

template <typename Solver>
std::size_t collide(const Geometry* o1, const Pose& X_W1, const Geometry* o2, const Pose& X_W2, const Solver* solver,
                    const fcl::CollisionRequest<double>& request, fcl::CollisionResult<double>& result) {
  return collide_function<Solver>.template get<decltype(collide<Solver>)>()(o1, X_W1, o2, X_W2, solver, request,
                                                                            result);
}

template <typename Solver>
double conservativeAdvancement(const Geometry* o1, const Motion* motion1, const Geometry* o2, const Motion* motion2,
                               const Solver* solver, const Request& request, Result& result) {
  return advancement_function<Solver>.template get<decltype(conservativeAdvancement<Solver>)>()(
      o1, motion1, o2, motion2, solver, request, result);
}

#define BOCST_INSTANTIATE(Solver)                                                                         \
  template std::size_t collide(const Geometry*, const Pose&, const Geometry*, const Pose&, const Solver*, \
                               const fcl::CollisionRequest<double>&, fcl::CollisionResult<double>&);      \
  template double conservativeAdvancement(const Geometry*, const Motion*, const Geometry*, const Motion*, \
                                          const Solver*, const Request&, Result&);
BOCST_INSTANTIATE(Libccd)
BOCST_INSTANTIATE(Indep)
#undef BOCST_INSTANTIATE

double continuousCollide(const Geometry* o1, const Motion* motion1, const Geometry* o2, const Motion* motion2,
                         const Request& request, Result& result) {
  using F = double(const Geometry*, const Motion*, const Geometry*, const Motion*, const Request&, Result&);
  return motions_function.get<F>()(o1, motion1, o2, motion2, request, result);
}

double continuousCollide(const Geometry* o1, const Pose& X_W1_begin, const Pose& X_W1_end, const Geometry* o2,
                         const Pose& X_W2_begin, const Pose& X_W2_end, const Request& request, Result& result) {
  using F = double(const Geometry*, const Pose&, const Pose&, const Geometry*, const Pose&, const Pose&, const Request&,
                   Result&);
  return poses_function.get<F>()(o1, X_W1_begin, X_W1_end, o2, X_W2_begin, X_W2_end, request, result);
}

}  // namespace bocst::fcl_adapter::libfcl
