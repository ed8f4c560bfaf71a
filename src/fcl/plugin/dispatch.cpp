// SPDX-License-Identifier: BSD-3-Clause
// clang-format off
#include "fcl/plugin/registration.h"  // First, see there.
// clang-format on

#include "fcl/plugin/dispatch.h"

#include <bocst/dispatch_check.h>
#include <bocst/unchecked_dispatch.h>
#include <dlfcn.h>
#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/ellipsoid.h>

#include <atomic>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "fcl/adapters/models.h"

namespace bocst {
namespace fcl_adapter {
namespace {

const char* scalarName(float) { return "float"; }
const char* scalarName(double) { return "double"; }

/// True if the dynamic linker found libfcl's own copy, which reads a table that nobody else can reach.
bool isInLibfcl(const void* address) {
  Dl_info info;
  if (dladdr(address, &info) == 0 || info.dli_fname == nullptr) return false;
  const char* slash = std::strrchr(info.dli_fname, '/');
  const char* file = slash != nullptr ? slash + 1 : info.dli_fname;
  return std::strncmp(file, "libfcl.", 7) == 0;
}

template <typename S>
std::string complaint() {
  return std::string("bocst: fcl::collide<") + scalarName(S()) +
         "> in this process does not reach bocst, so code that was compiled without <bocst/fcl.h> would be told that "
         "nothing collides. There are three ways to fix this. (1) Link the executable with libbocst before libfcl, and "
         "keep it, also if only a plugin of the executable uses bocst (CMake: target_link_libraries(app bocst::bocst "
         "...) with bocst::bocst before fcl; else -Wl,--no-as-needed -lbocst -lfcl -lccd). (2) Load libbocst first "
         "(LD_PRELOAD=libbocst.so; in Python, before anything that loads libfcl). With (1) and (2), code that makes "
         "its "
         "own copies of FCL's templates (anything in float, a query with a solver) must be compiled without "
         "-fvisibility=hidden. (3) Include <bocst/fcl.h> wherever FCL's queries are called, and turn this check off: "
         "bocst::setDispatchCheck(false) or BOCST_DISPATCH_CHECK=off";
}

/// Calls through a volatile pointer, so that it is the dynamic linker that says whose code runs, and not the compiler.
template <typename F>
struct Symbol {
  explicit Symbol(F* f) : pointer(f) {}
  const void* address() const {
    F* f = pointer;
    const void* p = nullptr;
    static_assert(sizeof p == sizeof f, "function pointers are addresses");
    std::memcpy(&p, &f, sizeof p);
    return p;
  }
  F* volatile pointer;
};

std::atomic<bool> check_is_on{true};
thread_local int unchecked = 0;  // UncheckedDispatch of this thread

bool checkIsOn() {
  static const bool allowed = [] {
    const char* check = std::getenv("BOCST_DISPATCH_CHECK");
    return check == nullptr || std::strcmp(check, "off") != 0;
  }();
  return allowed && unchecked == 0 && check_is_on.load(std::memory_order_relaxed);
}

/// Empty when all is well, else what is wrong.
template <typename S>
std::string probe() {
  using Geometry = const fcl::CollisionGeometry<S>*;
  using Pose = const fcl::Transform3<S>&;
  using Object = const fcl::CollisionObject<S>*;
  using Request = const fcl::CollisionRequest<S>&;
  using Result = fcl::CollisionResult<S>&;
  using Libccd = fcl::detail::GJKSolver_libccd<S>;
  const Symbol<std::size_t(Geometry, Pose, Geometry, Pose, Request, Result)> geometries(&fcl::collide<S>);
  const Symbol<std::size_t(Object, Object, Request, Result)> objects(&fcl::collide<S>);
  const Symbol<std::size_t(Geometry, Pose, Geometry, Pose, const Libccd*, Request, Result)> solver(
      &fcl::collide<S, Libccd>);
  const Symbol<S(Object, Object, const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&)> distances(&fcl::distance<S>);

  // Asking would only print FCL's warning.
  if (isInLibfcl(solver.address())) return complaint<S>();
  if (std::is_same<S, double>::value && libfcl::isFoundFirst()) return complaint<S>();

  const auto sentinel = std::make_shared<Sentinel<S>>();
  const fcl::Transform3<S> pose = fcl::Transform3<S>::Identity();
  const fcl::CollisionObject<S> object(sentinel);
  for (const fcl::GJKSolverType type : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
    fcl::CollisionRequest<S> request;
    request.gjk_solver_type = type;
    fcl::CollisionResult<S> result;
    fcl::DistanceRequest<S> distance_request;
    distance_request.gjk_solver_type = type;
    fcl::DistanceResult<S> distance_result;
    if (geometries.pointer(sentinel.get(), pose, sentinel.get(), pose, request, result) != Sentinel<S>::kReached ||
        objects.pointer(&object, &object, request, result) != Sentinel<S>::kReached ||
        distances.pointer(&object, &object, distance_request, distance_result) != Sentinel<S>::kReached) {
      return complaint<S>();
    }
  }
  return {};
}

}  // namespace

template <typename S>
void checkDispatch() {
  static const bool registered = [] {
    registerCollide<S>();
    registerDistance<S>();
    if (std::is_same<S, double>::value) registerContinuous();
    return true;
  }();
  if (!registered || !checkIsOn()) return;
  static const std::string wrong = probe<S>();
  if (!wrong.empty()) throw std::runtime_error(wrong);
}

template void checkDispatch<float>();
template void checkDispatch<double>();

}  // namespace fcl_adapter

void setDispatchCheck(bool on) { fcl_adapter::check_is_on = on; }

UncheckedDispatch::UncheckedDispatch() { ++fcl_adapter::unchecked; }
UncheckedDispatch::~UncheckedDispatch() { --fcl_adapter::unchecked; }

template <typename S>
bool isModel(const fcl::CollisionGeometry<S>* geometry) {
  return fcl_adapter::asModel<S>(geometry) != nullptr;
}

namespace {

/// FCL's table has a general test for this pair, which calls a support function that a plane does not have.
template <typename S>
void refusePlaneAndConvex(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  const fcl::NODE_TYPE type1 = o1->getNodeType(), type2 = o2->getNodeType();
  if ((type1 == fcl::GEOM_PLANE && type2 == fcl::GEOM_CONVEX) ||
      (type1 == fcl::GEOM_CONVEX && type2 == fcl::GEOM_PLANE)) {
    throw std::invalid_argument("bocst::collide: FCL knows no collision of " + fcl_adapter::typeName<S>(o1) + " and " +
                                fcl_adapter::typeName<S>(o2) + "; make the Convex a bocst::Model");
  }
}

}  // namespace

template <typename S>
std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                    const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                    const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result) {
  const auto by_fcl = [&] {
    refusePlaneAndConvex<S>(o1, o2);
    return fcl::collide<S>(o1, X_W1, o2, X_W2, request, result);
  };
  return fcl_adapter::collideOr<S>(by_fcl, o1, X_W1, o2, X_W2, {}, request, result);
}

template <typename S, typename Solver>
std::size_t collide(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                    const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2, const Solver* solver,
                    const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result) {
  const auto by_fcl = [&] {
    refusePlaneAndConvex<S>(o1, o2);
    return fcl::collide<S, Solver>(o1, X_W1, o2, X_W2, solver, request, result);
  };
  return fcl_adapter::collideOr<S>(by_fcl, o1, X_W1, o2, X_W2, solver, request, result);
}

namespace {

/// Why FCL has no distance to a geometry; null if it has one.
template <typename S>
const char* noDistanceTo(const fcl::CollisionGeometry<S>& o) {
  switch (o.getNodeType()) {
    case fcl::GEOM_PLANE:
    case fcl::GEOM_HALFSPACE:  // It would call a support function that these do not have.
      return "a Plane or Halfspace needs a bocst::Model beside it";
    case fcl::GEOM_ELLIPSOID:  // libccd ends the process.
      return static_cast<const fcl::Ellipsoid<S>&>(o).radii.minCoeff() > 0
                 ? nullptr
                 : "an Ellipsoid with a radius of 0 needs a bocst::Model beside it";
#if FCL_HAVE_OCTOMAP
    case fcl::GEOM_OCTREE:  // It would read a root that is not there.
      return static_cast<const fcl::OcTree<S>&>(o).getRoot() != nullptr ? nullptr : "the OcTree has no cells";
#endif
    default:
      return nullptr;
  }
}

template <typename S>
void refuseWithoutDistance(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  for (const fcl::CollisionGeometry<S>* o : {o1, o2}) {
    if (const char* const why = noDistanceTo(*o)) {
      throw std::invalid_argument("bocst::distance: FCL knows no distance of " + fcl_adapter::typeName<S>(o1) +
                                  " and " + fcl_adapter::typeName<S>(o2) + "; " + why);
    }
  }
}

}  // namespace

template <typename S>
S distance(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1, const fcl::CollisionGeometry<S>* o2,
           const fcl::Transform3<S>& X_W2, const fcl::DistanceRequest<S>& request, fcl::DistanceResult<S>& result) {
  switch (fcl_adapter::kindOf<S>("distance", o1, o2)) {
    case fcl_adapter::PairKind::kModel:
      return fcl_adapter::distancePair<S>(o1, X_W1, o2, X_W2, request, result);
    case fcl_adapter::PairKind::kNothing:
      return result.min_distance;
    case fcl_adapter::PairKind::kForeign:
      break;
  }
  refuseWithoutDistance<S>(o1, o2);
  return fcl::distance<S>(o1, X_W1, o2, X_W2, request, result);
}

template <typename S, typename Solver>
S distance(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1, const fcl::CollisionGeometry<S>* o2,
           const fcl::Transform3<S>& X_W2, const Solver* solver, const fcl::DistanceRequest<S>& request,
           fcl::DistanceResult<S>& result) {
  if (fcl_adapter::kindOf<S>("distance", o1, o2) != fcl_adapter::PairKind::kForeign) {
    return bocst::distance<S>(o1, X_W1, o2, X_W2, request, result);
  }
  refuseWithoutDistance<S>(o1, o2);
  return fcl::distance<Solver>(o1, X_W1, o2, X_W2, solver, request, result);
}

#define BOCST_INSTANTIATE_SOLVER(S, Solver)                                                                          \
  template std::size_t collide(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                          \
                               const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const Solver*,           \
                               const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);                           \
  template S distance(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
                      const fcl::Transform3<S>&, const Solver*, const fcl::DistanceRequest<S>&,                      \
                      fcl::DistanceResult<S>&);
#define BOCST_INSTANTIATE(S)                                                                                         \
  template bool isModel(const fcl::CollisionGeometry<S>*);                                                           \
  template std::size_t collide(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                          \
                               const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                          \
                               const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&);                           \
  template S distance(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&, const fcl::CollisionGeometry<S>*, \
                      const fcl::Transform3<S>&, const fcl::DistanceRequest<S>&, fcl::DistanceResult<S>&);           \
  BOCST_INSTANTIATE_SOLVER(S, fcl::detail::GJKSolver_libccd<S>)                                                      \
  BOCST_INSTANTIATE_SOLVER(S, fcl::detail::GJKSolver_indep<S>)
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE
#undef BOCST_INSTANTIATE_SOLVER

}  // namespace bocst
