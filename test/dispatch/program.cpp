// SPDX-License-Identifier: BSD-3-Clause
//
// A planner in small: it makes two models and asks FCL about them, with <bocst/fcl.h> (-DWITH_HEADER) or without.
// continuousCollideConservativeAdvancement is called by advancement.cpp.
// Exits with 0 when every answer was right, 1 when one was wrong, 3 with the complaint when bocst refused. As a plugin
// it has planner() for main(). With CHECK_OFF in the environment it turns the check off from code.

#ifdef WITH_HEADER
#include <bocst/bocst.h>
#else
#include <bocst/model.h>
#endif
#include <bocst/dispatch_check.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/geometry/shape/triangle_p.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/continuous_collision.h>
#include <fcl/narrowphase/distance.h>

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include "advancement.h"

#ifdef WITH_FLOAT
using S = float;
#else
using S = double;
#endif

namespace {

int failures = 0;

void expect(bool right, const std::string& what) {
  if (right) return;
  std::printf("WRONG: %s\n", what.c_str());
  ++failures;
}

std::shared_ptr<bocst::Model<S>> makeTetrahedron() {
  std::vector<Eigen::Vector3d> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<fcl::Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return std::make_shared<bocst::Model<S>>(std::make_shared<const bocst::Mesh>(std::move(vertices), triangles));
}

std::shared_ptr<fcl::BVHModel<fcl::OBBRSS<S>>> makeBvh() {
  auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSS<S>>>();
  bvh->beginModel();
  bvh->addTriangle(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(1, 0, 0), fcl::Vector3<S>(0, 1, 0));
  bvh->addTriangle(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(0, 1, 0), fcl::Vector3<S>(0, 0, 1));
  bvh->endModel();
  return bvh;
}

fcl::Transform3<S> moved(S x) {
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  X.translation() = fcl::Vector3<S>(x, 0, 0);
  return X;
}

using Geometry = std::shared_ptr<fcl::CollisionGeometry<S>>;

bool byGeometries(const Geometry& a, const Geometry& b, const fcl::Transform3<S>& X_WB, fcl::GJKSolverType solver) {
  fcl::CollisionRequest<S> request;
  request.gjk_solver_type = solver;
  fcl::CollisionResult<S> result;
  const std::size_t n = fcl::collide(a.get(), moved(0), b.get(), X_WB, request, result);
  expect((n > 0) == result.isCollision(), "the number returned is not the number of contacts");
  return result.isCollision();
}

bool byObjects(const Geometry& a, const Geometry& b, const fcl::Transform3<S>& X_WB, fcl::GJKSolverType solver) {
  fcl::CollisionObject<S> object1(a, moved(0)), object2(b, X_WB);
  fcl::CollisionRequest<S> request;
  request.gjk_solver_type = solver;
  fcl::CollisionResult<S> result;
  fcl::collide(&object1, &object2, request, result);
  return result.isCollision();
}

bool byManager(const Geometry& a, const Geometry& b, const fcl::Transform3<S>& X_WB, fcl::GJKSolverType solver) {
  fcl::CollisionObject<S> object1(a, moved(0)), object2(b, X_WB);
  fcl::DynamicAABBTreeCollisionManager<S> manager;
  manager.registerObject(&object1);
  manager.registerObject(&object2);
  manager.setup();
  fcl::DefaultCollisionData<S> data;
  data.request.gjk_solver_type = solver;
  manager.collide(&data, fcl::DefaultCollisionFunction<S>);
  return data.result.isCollision();
}

bool throwsInvalidArgument(const std::function<void()>& f) {
  try {
    f();
  } catch (const std::invalid_argument&) {
    return true;
  }
  return false;
}

void run() {
  const Geometry a = makeTetrahedron(), b = makeTetrahedron();
  const Geometry ball = std::make_shared<fcl::Sphere<S>>(S(1)), box = std::make_shared<fcl::Box<S>>(S(1), S(1), S(1));
  using Query = bool (*)(const Geometry&, const Geometry&, const fcl::Transform3<S>&, fcl::GJKSolverType);
  const struct {
    const char* name;
    Query query;
  } ways[] = {{"geometries", byGeometries}, {"objects", byObjects}, {"manager", byManager}};
  for (const auto& way : ways) {
    bool hit = true, is_free = true;
    for (const fcl::GJKSolverType solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
      hit = hit && way.query(a, b, moved(S(0.25)), solver) && way.query(a, b, moved(S(-0.25)), solver);
      is_free = is_free && !way.query(a, b, moved(S(3)), solver) && !way.query(b, a, moved(S(-3)), solver);
      expect(way.query(ball, box, moved(S(1.25)), solver) && !way.query(ball, box, moved(S(1.75)), solver),
             std::string(way.name) + ": a pair without a model is answered otherwise than by FCL");
    }
    std::printf("%s: overlapping %s, apart %s\n", way.name, hit ? "hit" : "free", is_free ? "free" : "hit");
    expect(hit, std::string(way.name) + ": overlapping models are told to be free");
    expect(is_free, std::string(way.name) + ": models apart are told to be in contact");
  }

  // FCL puts a mesh before a shape; a model must stay where it was put.
  for (const bool model_first : {true, false}) {
    const Geometry mesh = makeBvh();
    fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    const Geometry &first = model_first ? a : mesh, &second = model_first ? mesh : a;
    fcl::collide(first.get(), moved(0), second.get(), moved(S(0.25)), request, result);
    expect(result.isCollision() && result.getContact(0).o1 == first.get() && result.getContact(0).o2 == second.get(),
           "a model and an FCL mesh are told to be free, or were swapped");
  }
  for (const auto& way : ways) {
    for (const fcl::GJKSolverType solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
      expect(way.query(a, ball, moved(S(0.25)), solver) && way.query(box, a, moved(S(0.25)), solver) &&
                 !way.query(a, ball, moved(S(3)), solver) && !way.query(box, a, moved(S(3)), solver),
             std::string(way.name) + ": a model and a shape are not answered by bocst");
    }
  }
  // A partner that is not supported must not be told to be free.
  class Strange final : public fcl::CollisionGeometry<S> {
   public:
    void computeLocalAABB() override {}
  };
  const Geometry strange = std::make_shared<Strange>();
  expect(throwsInvalidArgument([&] { byGeometries(a, strange, moved(0), fcl::GST_LIBCCD); }),
         "a model and a geometry that nobody knows are told to be free");
  expect(throwsInvalidArgument([&] {
           fcl::DistanceRequest<S> request;
           fcl::DistanceResult<S> result;
           fcl::distance(strange.get(), moved(0), a.get(), moved(3), request, result);
         }),
         "distance from a geometry that nobody knows does not throw");
  for (int solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
    fcl::DistanceRequest<S> request;
    request.gjk_solver_type = static_cast<fcl::GJKSolverType>(solver);
    fcl::DistanceResult<S> result;
    const fcl::CollisionObject<S> object1(a, moved(0)), object2(a, moved(9));
    const S d = fcl::distance(&object1, &object2, request, result);
    expect(d > 0 && d < 9 && result.b1 >= 0, "the distance of two models is not bocst's");
    result.clear();
    const Geometry mesh = makeBvh();
    expect(fcl::distance(a.get(), moved(0), mesh.get(), moved(9), request, result) > 0 && result.b2 >= 0,
           "the distance of a model and an FCL mesh is not bocst's");
  }
  {
    fcl::CollisionObject<S> object1(a, moved(0)), object2(ball, moved(3));
    fcl::DistanceRequest<S> request;
    fcl::DistanceResult<S> result;
    const S to_ball = fcl::distance(&object1, &object2, request, result);
    expect(to_ball > 0 && to_ball < 2 && result.b1 >= 0, "the distance of a model and a ball is not bocst's");
    result.clear();
    object1 = fcl::CollisionObject<S>(box, moved(0));
    const S d = fcl::distance(&object1, &object2, request, result);
    expect(d > S(1.49) && d < S(1.51), "distance without a model is not FCL's");
  }
#ifndef WITH_FLOAT  // FCL 0.7 has no continuousCollide from poses for float.
  for (const fcl::CCDSolverType solver :
       {fcl::CCDC_NAIVE, fcl::CCDC_CONSERVATIVE_ADVANCEMENT, fcl::CCDC_RAY_SHOOTING, fcl::CCDC_POLYNOMIAL_SOLVER}) {
    for (const fcl::CCDMotionType type : {fcl::CCDM_TRANS, fcl::CCDM_LINEAR, fcl::CCDM_SCREW, fcl::CCDM_SPLINE}) {
      fcl::ContinuousCollisionRequest<S> request;
      request.ccd_solver_type = solver;
      request.ccd_motion_type = type;
      fcl::ContinuousCollisionResult<S> result;
      // The tetrahedra are one wide; from 3 apart to 1 the wrong way.
      fcl::continuousCollide(a.get(), moved(0), moved(0), b.get(), moved(3), moved(-1), request, result);
      expect(result.is_collide && result.time_of_contact > 0.499 && result.time_of_contact < 0.5001,
             "continuousCollide of models is not bocst's, solver " + std::to_string(solver) + ", motion " +
                 std::to_string(type));
      fcl::CollisionObject<S> object1(a, moved(0)), object2(b, moved(3));
      fcl::continuousCollide(&object1, moved(0), &object2, moved(5), request, result);
      expect(!result.is_collide, "continuousCollide of objects that recede is not bocst's");
    }
  }
  for (const fcl::GJKSolverType solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
    expect(advances(*a, *b, 3, -1, solver), "continuousCollideConservativeAdvancement of models is not bocst's");
    expect(!advances(*a, *b, 3, 5, solver),
           "continuousCollideConservativeAdvancement of models that recede is not bocst's");
  }
  {
    fcl::CollisionObject<S> object1(box, moved(0)), object2(ball, moved(3)), object3(a, moved(0)),
        object4(strange, moved(3));
    fcl::ContinuousCollisionRequest<S> request;
    request.ccd_solver_type = fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
    fcl::ContinuousCollisionResult<S> result;
    expect(
        throwsInvalidArgument([&] { fcl::continuousCollide(&object3, moved(3), &object4, moved(3), request, result); }),
        "continuousCollide with a partner that is not supported does not throw");
    fcl::continuousCollide(&object3, moved(3), &object2, moved(3), request, result);
    expect(result.is_collide && result.time_of_contact > 0 && result.time_of_contact < 1,
           "continuousCollide of a model and a ball is not bocst's");
    fcl::continuousCollide(&object1, moved(3), &object2, moved(3), request, result);
    expect(result.is_collide && result.time_of_contact > 0.4 && result.time_of_contact < 0.6,
           "continuousCollide without a model is not FCL's");
  }
#endif

  // FCL's other geometry of our node type: no function for it, which FCL says on cerr.
  const Geometry triangle =
      std::make_shared<fcl::TriangleP<S>>(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(1, 0, 0), fcl::Vector3<S>(0, 1, 0));
  expect(!byGeometries(triangle, box, moved(0), fcl::GST_LIBCCD), "a TriangleP was taken for a model");
}

}  // namespace

extern "C" __attribute__((visibility("default"))) int planner() {
  try {
    if (std::getenv("CHECK_OFF") != nullptr) bocst::setDispatchCheck(false);
    run();
  } catch (const std::exception& e) {
    std::printf("complaint: %s\n", e.what());
    return 3;
  }
  return failures == 0 ? 0 : 1;
}

int main() { return planner(); }
