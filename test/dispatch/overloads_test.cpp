// SPDX-License-Identifier: BSD-3-Clause
//
// With <bocst/fcl.h>, each public signature of FCL takes a model as it takes any other geometry.
#include <bocst/bocst.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/geometry/shape/triangle_p.h>
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace {

template <typename S>
std::shared_ptr<bocst::Model<S>> makeModel() {
  std::vector<Eigen::Vector3d> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  std::vector<fcl::Triangle> triangles{{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  return std::make_shared<bocst::Model<S>>(std::make_shared<const bocst::Mesh>(std::move(vertices), triangles));
}

template <typename S>
fcl::Transform3<S> moved(double x) {
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  X.translation() = fcl::Vector3<S>(static_cast<S>(x), 0, 0);
  return X;
}

/// A geometry that nobody knows.
template <typename S>
class Strange final : public fcl::CollisionGeometry<S> {
 public:
  void computeLocalAABB() override {}
};

/// Throws what it must, and says which geometries and which query.
template <typename F>
void expectRefusal(const std::string& query, const F& f) {
  try {
    f();
    ADD_FAILURE() << query << " did not throw";
  } catch (const std::invalid_argument& e) {
    for (const std::string& part : {query, std::string("bocst::Model<"), std::string("Strange<")}) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    }
  }
}

template <typename S>
struct Scene {
  std::shared_ptr<bocst::Model<S>> model = makeModel<S>(), other = makeModel<S>();
  std::shared_ptr<fcl::Sphere<S>> ball = std::make_shared<fcl::Sphere<S>>(S(1));
  fcl::Transform3<S> at0 = moved<S>(0), near = moved<S>(0.25), away = moved<S>(3);
  fcl::CollisionObject<S> model_object{model, at0}, near_object{other, near}, away_object{other, away};
  fcl::CollisionObject<S> ball_object{ball, at0}, away_ball_object{ball, away};
  fcl::detail::GJKSolver_libccd<S> libccd;
  fcl::detail::GJKSolver_indep<S> indep;
};

template <typename S>
class Overloads : public ::testing::Test {};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Overloads, Scalars);

TYPED_TEST(Overloads, CollideReachesModels) {
  using S = TypeParam;
  Scene<S> s;
  const fcl::CollisionRequest<S> request;
  const auto hits = [&](const auto& query) {
    fcl::CollisionResult<S> result;
    const std::size_t n = query(result);
    EXPECT_EQ(n, result.numContacts());
    return n > 0;
  };
  using R = fcl::CollisionResult<S>;
  auto &m = s.model, &o = s.other;
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(m.get(), s.at0, o.get(), s.near, request, r); }));
  EXPECT_FALSE(hits([&](R& r) { return fcl::collide(m.get(), s.at0, o.get(), s.away, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(m.get(), s.at0, o.get(), s.near, &s.libccd, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(m.get(), s.at0, o.get(), s.near, &s.indep, request, r); }));
  EXPECT_FALSE(hits([&](R& r) { return fcl::collide(m.get(), s.at0, o.get(), s.away, &s.libccd, request, r); }));

  auto &a = s.model_object, &b = s.near_object, &c = s.away_object;
  const fcl::CollisionObject<S>& const_a = a;
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(&a, &b, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(&const_a, &b, request, r); }));
  EXPECT_FALSE(hits([&](R& r) { return fcl::collide(&a, &c, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(&a, &b, &s.libccd, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide(&a, &b, &s.indep, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return collide(&a, &b, request, r); })) << "by argument-dependent lookup";

  // FCL's template by name is not overloaded; it takes the way of code without our header.
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide<S>(&a, &b, request, r); }));
  EXPECT_TRUE(hits([&](R& r) { return fcl::collide<S>(m.get(), s.at0, o.get(), s.near, &s.indep, request, r); }));
}

TYPED_TEST(Overloads, CollideWithoutModelsIsFcls) {
  using S = TypeParam;
  Scene<S> s;
  const fcl::CollisionRequest<S> request;
  fcl::CollisionResult<S> result;
  auto &a = s.ball_object, &b = s.away_ball_object;
  EXPECT_EQ(fcl::collide(&a, &b, request, result), 0u);
  EXPECT_EQ(fcl::collide(&a, &a, request, result), 1u);
  result.clear();
  EXPECT_EQ(fcl::collide(&a, &a, &s.indep, request, result), 1u);
  result.clear();
  EXPECT_EQ(fcl::collide(s.ball.get(), s.at0, s.ball.get(), s.near, &s.libccd, request, result), 1u);

  const auto triangle =
      std::make_shared<fcl::TriangleP<S>>(fcl::Vector3<S>(0, 0, 0), fcl::Vector3<S>(1, 0, 0), fcl::Vector3<S>(0, 1, 0));
  EXPECT_EQ(triangle->getNodeType(), s.model->getNodeType());
  EXPECT_FALSE(bocst::isModel<S>(triangle.get()));
  EXPECT_TRUE(bocst::isModel<S>(s.model.get()));
  EXPECT_FALSE(bocst::isModel<S>(nullptr));
  result.clear();
  EXPECT_EQ(fcl::collide(triangle.get(), s.at0, s.ball.get(), s.at0, request, result), 0u);
}

TYPED_TEST(Overloads, NoContactsAskedForIsNone) {
  using S = TypeParam;
  Scene<S> s;
  fcl::CollisionRequest<S> request;
  request.num_max_contacts = 0;
  fcl::CollisionResult<S> result;
  EXPECT_EQ(fcl::collide(&s.model_object, &s.near_object, request, result), 0u);
  EXPECT_EQ(result.numContacts(), 0u);
}

TYPED_TEST(Overloads, DistanceReachesModels) {
  using S = TypeParam;
  Scene<S> s;
  const fcl::DistanceRequest<S> request;
  const auto check = [](auto&& ask) {
    fcl::DistanceResult<S> result;
    EXPECT_GT(ask(result), 0);
    EXPECT_GE(result.b1, 0) << "the answer of a mesh names its triangles";
  };
  const auto far = moved<S>(9);
  const fcl::CollisionObject<S> far_object(s.model, far);
  auto& m = s.model;
  auto& a = s.model_object;
  check([&](auto& r) { return fcl::distance(m.get(), s.at0, m.get(), far, request, r); });
  check([&](auto& r) { return fcl::distance(m.get(), s.at0, m.get(), far, &s.libccd, request, r); });
  check([&](auto& r) { return fcl::distance(m.get(), s.at0, m.get(), far, &s.indep, request, r); });
  check([&](auto& r) { return fcl::distance(&a, &far_object, request, r); });
  check([&](auto& r) { return fcl::distance(&a, &far_object, &s.libccd, request, r); });
  check([&](auto& r) { return fcl::distance(&a, &far_object, &s.indep, request, r); });
  check([&](auto& r) { return fcl::distance<S>(&a, &far_object, request, r); });
}

TYPED_TEST(Overloads, DistanceRefusesOtherPartners) {
  using S = TypeParam;
  Scene<S> s;
  const fcl::DistanceRequest<S> request;
  fcl::DistanceResult<S> result;
  auto& m = s.model;
  const auto strange = std::make_shared<Strange<S>>();
  expectRefusal("distance", [&] { fcl::distance(m.get(), s.at0, strange.get(), s.away, request, result); });
  expectRefusal("distance", [&] { fcl::distance(strange.get(), s.at0, m.get(), s.away, request, result); });
  expectRefusal("distance", [&] { fcl::distance(m.get(), s.at0, strange.get(), s.away, &s.libccd, request, result); });
  expectRefusal("distance", [&] { fcl::distance(m.get(), s.at0, strange.get(), s.away, &s.indep, request, result); });
  const fcl::CollisionObject<S>&a = s.model_object, b(strange, s.away);
  expectRefusal("distance", [&] { fcl::distance(&a, &b, request, result); });
  expectRefusal("distance", [&] { fcl::distance(&a, &b, &s.libccd, request, result); });
  expectRefusal("distance", [&] { fcl::distance(&b, &a, &s.indep, request, result); });
  expectRefusal("distance", [&] { fcl::distance<S>(&a, &b, request, result); });

  EXPECT_NEAR(fcl::distance(&s.ball_object, &s.away_ball_object, request, result), 1, 1e-3);
  result.clear();
  EXPECT_NEAR(fcl::distance(&s.ball_object, &s.away_ball_object, &s.libccd, request, result), 1, 1e-3);
}

TYPED_TEST(Overloads, ContinuousCollideReachesModels) {
  using S = TypeParam;
  Scene<S> s;
  const fcl::TranslationMotion<S> still(s.at0, s.at0), motion(moved<S>(3), moved<S>(-1));
  fcl::ContinuousCollisionRequest<S> request;
  const auto check = [](auto&& ask) {
    fcl::ContinuousCollisionResult<S> result;
    EXPECT_NEAR(ask(result), 0.5, 2e-4);
    EXPECT_TRUE(result.is_collide);
    EXPECT_NEAR(result.time_of_contact, 0.5, 2e-4);
  };
  auto &m = s.model, &o = s.other;
  auto &a = s.model_object, &c = s.away_object;
  for (const auto type : {fcl::CCDM_TRANS, fcl::CCDM_LINEAR, fcl::CCDM_SCREW, fcl::CCDM_SPLINE}) {
    request.ccd_motion_type = type;
    check([&](auto& r) { return fcl::continuousCollide(m.get(), &still, o.get(), &motion, request, r); });
    check([&](auto& r) {
      return fcl::continuousCollide(m.get(), s.at0, s.at0, o.get(), moved<S>(3), moved<S>(-1), request, r);
    });
    check([&](auto& r) { return fcl::continuousCollide(&a, s.at0, &c, moved<S>(-1), request, r); });
    check([&](auto& r) { return continuousCollide(&a, s.at0, &c, moved<S>(-1), request, r); });
  }
}

TEST(OverloadsOfContinuousCollide, OfObjectsAndByName) {
  using S = double;
  const auto model = makeModel<S>();
  const auto ball = std::make_shared<fcl::Sphere<S>>(1);
  const auto at0 = moved<S>(0), away = moved<S>(3);
  const auto strange = std::make_shared<Strange<S>>();
  const fcl::TranslationMotion<S> still(at0, at0);
  fcl::CollisionObject<S> strange_object(strange, away), model_object(model, at0), ball_object(ball, away),
      other_ball(ball, at0), other(model, away);
  const auto motion_of = [&](const auto& X, const auto& Y) {
    return std::make_shared<fcl::TranslationMotion<S>>(X, Y);
  };
  fcl::ContinuousCollisionObject<S> moving_model(model, motion_of(at0, at0)),
      coming_ball(ball, motion_of(away, moved<S>(-1))), moving_strange(strange, motion_of(at0, away));
  fcl::ContinuousCollisionObject<S> coming_model(model, motion_of(away, moved<S>(-1)));
  fcl::ContinuousCollisionResult<S> result;
  for (const auto solver :
       {fcl::CCDC_NAIVE, fcl::CCDC_CONSERVATIVE_ADVANCEMENT, fcl::CCDC_RAY_SHOOTING, fcl::CCDC_POLYNOMIAL_SOLVER}) {
    fcl::ContinuousCollisionRequest<S> request;
    request.ccd_solver_type = solver;
    EXPECT_NEAR(fcl::collide(&moving_model, &coming_model, request, result), 0.5, 2e-4);
    EXPECT_NEAR(fcl::continuousCollide<S>(&model_object, at0, &other, moved<S>(-1), request, result), 0.5, 2e-4);
    EXPECT_NEAR(fcl::continuousCollide<S>(model.get(), at0, at0, model.get(), away, moved<S>(-1), request, result), 0.5,
                2e-4);
    // As the callback for broadphase managers asks.
    fcl::DefaultContinuousCollisionData<S> data;
    data.request = request;
    fcl::DefaultContinuousCollisionFunction(&moving_model, &coming_model, &data);
    EXPECT_TRUE(data.result.is_collide);
    EXPECT_NEAR(data.result.time_of_contact, 0.5, 2e-4);

    // A ball comes from 3, and is in touch at 2.
    const fcl::TranslationMotion<S> coming(away, moved<S>(-1));
    EXPECT_NEAR(fcl::continuousCollide(model.get(), &still, ball.get(), &coming, request, result), 0.25, 2e-4);
    EXPECT_NEAR(fcl::continuousCollide(ball.get(), away, moved<S>(-1), model.get(), at0, at0, request, result), 0.25,
                2e-4);
    EXPECT_NEAR(fcl::continuousCollide(&model_object, at0, &ball_object, moved<S>(-1), request, result), 0.25, 2e-4);
    EXPECT_NEAR(fcl::collide(&moving_model, &coming_ball, request, result), 0.25, 2e-4);
    EXPECT_NEAR(fcl::continuousCollide<S>(&model_object, at0, &ball_object, moved<S>(-1), request, result), 0.25, 2e-4);
    EXPECT_THROW(fcl::continuousCollide(model.get(), &still, strange.get(), &coming, request, result),
                 std::invalid_argument);
    EXPECT_THROW(fcl::continuousCollide(strange.get(), away, at0, model.get(), away, away, request, result),
                 std::invalid_argument);
    EXPECT_THROW(fcl::continuousCollide(&model_object, away, &strange_object, away, request, result),
                 std::invalid_argument);
    EXPECT_THROW(fcl::collide(&moving_model, &moving_strange, request, result), std::invalid_argument);
    EXPECT_THROW(fcl::continuousCollide<S>(&model_object, away, &strange_object, away, request, result),
                 std::invalid_argument);
  }
  fcl::ContinuousCollisionRequest<S> request;
  request.ccd_solver_type = fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
  fcl::continuousCollide(&other_ball, away, &ball_object, away, request, result);
  EXPECT_TRUE(result.is_collide);
  EXPECT_NEAR(result.time_of_contact, 1. / 3, 1e-2);
  // FCL 0.7 itself does not compile from poses with float.
  const auto ballf = std::make_shared<fcl::Sphere<float>>(1.f);
  fcl::ContinuousCollisionResult<float> resultf;
  EXPECT_THROW(fcl::continuousCollide(ballf.get(), moved<float>(0), moved<float>(0), ballf.get(), moved<float>(0),
                                      moved<float>(0), fcl::ContinuousCollisionRequest<float>(), resultf),
               std::invalid_argument);
}

TEST(Dispatch, FirstModelsFromManyThreads) {
  std::vector<std::thread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([] {
      const auto a = makeModel<float>();
      const auto b = makeModel<double>();
      EXPECT_TRUE(a && b);
    });
  }
  for (std::thread& t : threads) t.join();
}

}  // namespace
