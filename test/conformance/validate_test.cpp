// SPDX-License-Identifier: BSD-3-Clause
// What is no rigid pose, no tolerance and no option is refused, beside every kind of partner and in both orders; pairs
// without a model are left to FCL.
#include "fcl/adapters/validate.h"

#include <bocst/bocst.h>
#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/math/motion/translation_motion.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <stdexcept>
#include <string>

#include "meshes.h"
#include "reference.h"

namespace bocst {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// f throws std::invalid_argument whose text has each of the parts.
template <typename F>
void expectRefusal(const F& f, const std::vector<std::string>& parts) {
  try {
    f();
    ADD_FAILURE() << "nothing was thrown; expected: " << ::testing::PrintToString(parts);
  } catch (const std::invalid_argument& e) {
    for (const std::string& part : parts) {
      EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what() << "\nlacks " << part;
    }
  }
}

/// Writes a number into an enum that has no such value.
template <typename Enum>
void setEnum(Enum& e, int value) {
  static_assert(sizeof e == sizeof value, "an enum is an int");
  std::memcpy(&e, &value, sizeof value);
}

Eigen::Matrix3d someRotation(std::mt19937& g) {
  std::normal_distribution<double> n;
  return Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized().toRotationMatrix();
}

/// The largest entry of R^T R - 1.
template <typename S>
double orthogonalityError(const fcl::Transform3<S>& X) {
  const Eigen::Matrix3d R = X.linear().template cast<double>();
  return (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
}

template <typename S>
class Validate : public ::testing::Test {
 protected:
  using Geometry = std::shared_ptr<fcl::CollisionGeometry<S>>;
  using Pose = fcl::Transform3<S>;

  Validate() {
    const test::Raw raw = test::box({0, 0, 0}, {1, 1, 1});
    model = std::make_shared<Model<S>>(raw.mesh());
    Options conservative;
    conservative.answer = Answer::kConservative;
    partners = {std::make_shared<Model<S>>(raw.mesh()), std::make_shared<Model<S>>(raw.mesh(), conservative),
                test::bvh<fcl::OBBRSS<S>>(raw), std::make_shared<fcl::Box<S>>(S(1), S(1), S(1))};
#if FCL_HAVE_OCTOMAP
    auto octomap = std::make_shared<octomap::OcTree>(0.25);
    octomap->updateNode(octomap::point3d(0.1f, 0.1f, 0.1f), true);
    partners.push_back(std::make_shared<fcl::OcTree<S>>(octomap));
#endif
  }

  /// Asks all queries about a pair, with each geometry at the bad pose, and expects refusals with these parts.
  void expectRefused(const Pose& bad, const std::string& what) {
    const Pose I = Pose::Identity();
    for (const Geometry& partner : partners) {
      for (const bool first : {true, false}) {
        const std::string n = first ? "1" : "2";
        const Pose &X = first ? bad : I, &Y = first ? I : bad;
        for (const auto& [a, b] : {std::pair(model.get(), partner.get()), std::pair(partner.get(), model.get())}) {
          expectRefusal([&, a = a, b = b] { collide(a, X, b, Y); }, {"collide", "tf" + n, what});
          expectRefusal([&, a = a, b = b] { distance(a, X, b, Y); }, {"distance", "tf" + n, what});
          fcl::ContinuousCollisionRequest<S> request;
          fcl::ContinuousCollisionResult<S> result;
          expectRefusal([&, a = a, b = b] { fcl::continuousCollide(a, X, I, b, Y, I, request, result); },
                        {"continuousCollide", "tf" + n + "_beg", what});
          expectRefusal([&, a = a, b = b] { fcl::continuousCollide(a, I, X, b, I, Y, request, result); },
                        {"continuousCollide", "tf" + n + "_end", what});
          // FCL's motions keep rotations as quaternions, and so make others of what is none.
          if (bad.translation().allFinite()) continue;
          // By this name, since FCL's own code for motions in float is very slow to compile.
          const fcl::TranslationMotion<S> motion1(X, X), motion2(Y, Y);
          expectRefusal(
              [&, a = a, b = b] { fcl_adapter::continuousPair<S>(a, &motion1, b, &motion2, request, result); },
              {"continuousCollide", "motion" + n});
        }
      }
    }
  }

  std::size_t collide(const fcl::CollisionGeometry<S>* a, const Pose& X, const fcl::CollisionGeometry<S>* b,
                      const Pose& Y) {
    fcl::CollisionResult<S> result;
    return fcl::collide(a, X, b, Y, collision, result);
  }
  S distance(const fcl::CollisionGeometry<S>* a, const Pose& X, const fcl::CollisionGeometry<S>* b, const Pose& Y) {
    fcl::DistanceResult<S> result;
    return fcl::distance(a, X, b, Y, separation, result);
  }
  void collideAll() {
    for (const Geometry& partner : partners) {
      collide(model.get(), Pose::Identity(), partner.get(), Pose::Identity());
      collide(partner.get(), Pose::Identity(), model.get(), Pose::Identity());
    }
  }
  void distanceAll() {
    for (const Geometry& partner : partners) {
      distance(model.get(), Pose::Identity(), partner.get(), Pose::Identity());
      distance(partner.get(), Pose::Identity(), model.get(), Pose::Identity());
    }
  }

  Geometry model;
  std::vector<Geometry> partners;
  fcl::CollisionRequest<S> collision;
  fcl::DistanceRequest<S> separation;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Validate, Scalars);

TYPED_TEST(Validate, RefusesTranslationsThatAreNotFinite) {
  using S = TypeParam;
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (int k = 0; k < 3; ++k) {
      fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
      X.translation()[k] = static_cast<S>(bad);
      this->expectRefused(X, std::isnan(bad) ? "nan" : "inf");
    }
  }
}

TYPED_TEST(Validate, RefusesWhatIsNoRotation) {
  using S = TypeParam;
  std::mt19937 g(5);
  const auto refuse = [&](const Eigen::Matrix3d& R, const char* what) {
    this->expectRefused(test::pose<S>(R, {0.1, 0.2, 0.3}), what);
  };
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      Eigen::Matrix3d R = someRotation(g);
      R(r, c) = kNaN;
      refuse(R, "not finite");
      R(r, c) = -kInfinity;
      refuse(R, "not finite");
    }
  }
  const Eigen::Matrix3d R = someRotation(g), I = Eigen::Matrix3d::Identity();
  refuse(Eigen::Matrix3d::Zero(), "off the identity by 1;");
  refuse(3 * I, "off the identity by 8;");
  refuse(R * 1.001, "off the identity by 0.002");
  refuse(R / 1e200, "off the identity by 1;");
  Eigen::Matrix3d shear = I;
  shear(0, 1) = 0.01;
  refuse(R * shear, "off the identity by 0.0");
  // Neither volume nor the sum of squares tells these from rotations.
  refuse(R * Eigen::Vector3d(2, 0.5, 1).asDiagonal(), "off the identity by 3;");
  refuse(std::sqrt(3.0) * Eigen::Vector3d::UnitX().asDiagonal().toDenseMatrix(), "off the identity by 2;");
  refuse(-I, "reflection");
  refuse(R * Eigen::Vector3d(1, 1, -1).asDiagonal(), "reflection");
  refuse(R.col(0) * R.col(0).transpose(), "off the identity by");
}

TYPED_TEST(Validate, TakesRotationsUpToRounding) {
  using S = TypeParam;
  std::mt19937 g(6);
  for (int round = 0; round < 20; ++round) {
    // A rotation of floats that is turned a thousand times and never made orthogonal again.
    Eigen::Matrix3f R = someRotation(g).cast<float>(), turn = someRotation(g).cast<float>();
    for (int i = 0; i < 1000; ++i) R = turn * R;
    const fcl::Transform3<S> X = test::pose<S>(R.cast<double>(), {1e30, -1e30, 0});
    ASSERT_LT(orthogonalityError(X), fcl_adapter::kMaxOrthogonalityError);
    for (const auto& partner : this->partners) {
      EXPECT_NO_THROW(this->collide(this->model.get(), X, partner.get(), X));
      EXPECT_NO_THROW(this->collide(partner.get(), X, this->model.get(), fcl::Transform3<S>::Identity()));
    }
  }
}

// The quick test must never take what the exact one refuses, and the exact one decides at the bound.
TYPED_TEST(Validate, DecidesByTheStatedBound) {
  using S = TypeParam;
  std::mt19937 g(7);
  std::uniform_real_distribution<double> u(-1, 1);
  std::uniform_real_distribution<double> size(-6, 0.5);
  int taken = 0, refused = 0, quick = 0;
  for (int i = 0; i < 200000; ++i) {
    Eigen::Matrix3d change;
    for (int k = 0; k < 9; ++k) change(k / 3, k % 3) = u(g);
    if (i % 3 == 0) change = change.diagonal().asDiagonal();
    const Eigen::Matrix3d R = someRotation(g) * (Eigen::Matrix3d::Identity() + std::pow(10, size(g)) * change);
    const auto X = test::pose<S>(i % 7 == 0 ? Eigen::Matrix3d(-R) : R, {0, 0, 0});
    const bool is_rigid = orthogonalityError(X) <= fcl_adapter::kMaxOrthogonalityError &&
                          X.linear().template cast<double>().determinant() > 0;
    bool accepts = true;
    try {
      fcl_adapter::checkPose("query", "tf", X);
    } catch (const std::invalid_argument&) {
      accepts = false;
    }
    ASSERT_EQ(accepts, is_rigid) << X.matrix();
    if (fcl_adapter::isSurelyRigid(X)) {
      ASSERT_LE(orthogonalityError(X), 3e-4);
    }
    (is_rigid ? taken : refused)++;
    quick += fcl_adapter::isSurelyRigid(X);
  }
  EXPECT_GT(taken, 10000);
  EXPECT_GT(refused, 10000);
  EXPECT_GT(quick, 10000);
}

TYPED_TEST(Validate, RefusesTolerancesThatAreNone) {
  using S = TypeParam;
  using Libccd = fcl::detail::GJKSolver_libccd<S>;
  using Indep = fcl::detail::GJKSolver_indep<S>;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  const struct {
    S value;
    const char* text;
  } bad[] = {{S(-1e-6), "-1e-06"}, {static_cast<S>(kNaN), "nan"}, {static_cast<S>(kInfinity), "inf"}};
  for (const auto& b : bad) {
    for (const auto& partner : this->partners) {
      this->collision.gjk_tolerance = b.value;
      expectRefusal([&] { this->collide(this->model.get(), I, partner.get(), I); },
                    {"collide", "gjk_tolerance", b.text});
      for (S fcl::DistanceRequest<S>::*field : {&fcl::DistanceRequest<S>::rel_err, &fcl::DistanceRequest<S>::abs_err,
                                                &fcl::DistanceRequest<S>::distance_tolerance}) {
        this->separation = fcl::DistanceRequest<S>();
        this->separation.*field = b.value;
        const char* name = field == &fcl::DistanceRequest<S>::rel_err   ? "rel_err"
                           : field == &fcl::DistanceRequest<S>::abs_err ? "abs_err"
                                                                        : "distance_tolerance";
        expectRefusal([&] { this->distance(partner.get(), I, this->model.get(), I); }, {"distance", name, b.text});
      }
      fcl::ContinuousCollisionRequest<S> continuous;
      fcl::ContinuousCollisionResult<S> result;
      continuous.toc_err = b.value;
      expectRefusal([&] { fcl::continuousCollide(this->model.get(), I, I, partner.get(), I, I, continuous, result); },
                    {"continuousCollide", "toc_err", b.text});
    }
    // A solver of the caller's, beside what needs one.
    const auto& shape = this->partners[3];
    fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    Libccd libccd;
    libccd.collision_tolerance = b.value;
    expectRefusal([&] { fcl::collide(this->model.get(), I, shape.get(), I, &libccd, request, result); },
                  {"collide", "collision_tolerance", b.text});
    Indep indep;
    indep.gjk_tolerance = b.value;
    expectRefusal([&] { fcl::collide(this->model.get(), I, shape.get(), I, &indep, request, result); },
                  {"collide", "gjk_tolerance", b.text});
  }
  this->collision.gjk_tolerance = 0;
  EXPECT_NO_THROW(this->collideAll());
}

TYPED_TEST(Validate, RefusesNaNInRequestsAndResults) {
  using S = TypeParam;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  this->collision.cached_gjk_guess[1] = static_cast<S>(kNaN);
  EXPECT_NO_THROW(this->collideAll()) << "without enable_cached_gjk_guess nobody reads it";
  this->collision.enable_cached_gjk_guess = true;
  expectRefusal([&] { this->collideAll(); }, {"collide", "cached_gjk_guess", "nan"});
  fcl::DistanceResult<S> result(static_cast<S>(kNaN));
  expectRefusal([&] { fcl::distance(this->model.get(), I, this->partners[0].get(), I, this->separation, result); },
                {"distance", "min_distance", "nan"});
}

TYPED_TEST(Validate, RefusesEnumsThatHaveNoSuchValue) {
  using S = TypeParam;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  for (const int bad : {-1, 2, 1000}) {
    setEnum(this->collision.gjk_solver_type, bad);
    setEnum(this->separation.gjk_solver_type, bad);
    expectRefusal([&] { this->collideAll(); }, {"collide", "gjk_solver_type", std::to_string(bad)});
    expectRefusal([&] { this->distanceAll(); }, {"distance", "gjk_solver_type", std::to_string(bad)});
  }
  const auto refuse = [&](const fcl::ContinuousCollisionRequest<S>& request, const char* field) {
    for (const auto& partner : this->partners) {
      fcl::ContinuousCollisionResult<S> result;
      expectRefusal([&] { fcl::continuousCollide(this->model.get(), I, I, partner.get(), I, I, request, result); },
                    {"continuousCollide", field, "9"});
    }
  };
  fcl::ContinuousCollisionRequest<S> request;
  setEnum(request.ccd_motion_type, 9);
  refuse(request, "ccd_motion_type");
  request = {};
  setEnum(request.ccd_solver_type, 9);
  refuse(request, "ccd_solver_type");
  request = {};
  setEnum(request.gjk_solver_type, 9);
  refuse(request, "gjk_solver_type");
}

TYPED_TEST(Validate, RefusesOptionsThatDoNotExist) {
  const auto mesh = test::box({0, 0, 0}, {1, 1, 1}).mesh();
  const auto refuse = [&](const char* field, auto&& change) {
    Options options;
    change(options);
    expectRefusal([&] { Model<TypeParam>(mesh, options); }, {"Options", field});
  };
  for (const int bad : {-1, 5, 77}) {
    refuse("subdivision", [bad](Options& o) { o.subdivision = static_cast<Subdivision>(bad); });
    refuse("answer", [bad](Options& o) { o.answer = static_cast<Answer>(bad); });
    refuse("oracle", [bad](Options& o) { o.oracle = static_cast<OracleKind>(bad); });
  }
  refuse("margin", [](Options& o) { o.margin = kNaN; });
  refuse("dimension", [](Options& o) { o.dimension = kNaN; });
  refuse("ttl", [](Options& o) { o.ttl = std::chrono::milliseconds(-1); });
}

/// A geometry that FCL has no functions for.
template <typename S>
struct Unknown final : fcl::CollisionGeometry<S> {
  void computeLocalAABB() override {}
};

TYPED_TEST(Validate, RefusesGeometriesThatAreNullOrUnknown) {
  using S = TypeParam;
  const Model<S> box(test::box({0, 0, 0}, {1, 1, 1}).mesh());
  const Unknown<S> unknown;
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  using Pointer = const fcl::CollisionGeometry<S>*;
  for (const Pointer other : {Pointer{nullptr}, Pointer{&unknown}}) {
    for (const bool is_first : {true, false}) {
      const Pointer o1 = is_first ? other : &box, o2 = is_first ? &box : other;
      const std::string what = other != nullptr ? "Unknown" : is_first ? "o1 is a null" : "o2 is a null";
      expectRefusal([&] { this->collide(o1, I, o2, I); }, {"bocst::collide", what});
      expectRefusal([&] { this->distance(o1, I, o2, I); }, {"bocst::distance", what});
      expectRefusal([&] { isCloserThan<S>(o1, I, o2, I, S(1)); }, {"bocst::isCloserThan", what});
      expectRefusal(
          [&] {
            fcl::ContinuousCollisionResult<S> result;
            bocst::continuousCollide<S>(o1, I, I, o2, I, I, fcl::ContinuousCollisionRequest<S>(), result);
          },
          {"bocst::continuousCollide", what});
    }
  }
}

// Also where neither is a model, and FCL would read through the pointer.
TYPED_TEST(Validate, RefusesNullBesideShapes) {
  using S = TypeParam;
  const fcl::Sphere<S> ball(S(1));
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  using Pointer = const fcl::CollisionGeometry<S>*;
  for (const auto& [o1, o2, what] : {std::tuple(Pointer{nullptr}, Pointer{&ball}, "o1 is a null"),
                                     std::tuple(Pointer{&ball}, Pointer{nullptr}, "o2 is a null"),
                                     std::tuple(Pointer{nullptr}, Pointer{nullptr}, "o1 is a null")}) {
    const Pointer a = o1, b = o2;
    const fcl::detail::GJKSolver_indep<S> solver;
    fcl::DistanceResult<S> least;
    fcl::CollisionResult<S> contacts;
    fcl::ContinuousCollisionResult<S> time;
    const fcl::TranslationMotion<S> motion(I, I);
    const fcl::ContinuousCollisionRequest<S> request;
    expectRefusal([&] { this->collide(a, I, b, I); }, {"bocst::collide", what});
    expectRefusal([&] { fcl::collide(a, I, b, I, &solver, fcl::CollisionRequest<S>(), contacts); },
                  {"bocst::collide", what});
    expectRefusal([&] { this->distance(a, I, b, I); }, {"bocst::distance", what});
    expectRefusal([&] { fcl::distance(a, I, b, I, &solver, fcl::DistanceRequest<S>(), least); },
                  {"bocst::distance", what});
    expectRefusal([&] { bocst::continuousCollide<S>(a, I, I, b, I, I, request, time); },
                  {"bocst::continuousCollide", what});
    expectRefusal([&] { bocst::continuousCollide<S>(a, &motion, b, &motion, request, time); },
                  {"bocst::continuousCollide", what});
  }
}

TYPED_TEST(Validate, IsCloserThanNeedsAModel) {
  using S = TypeParam;
  const fcl::Sphere<S> ball(S(1));
  const fcl::Transform3<S> I = fcl::Transform3<S>::Identity();
  try {
    isCloserThan<S>(&ball, I, &ball, I, S(1));
    ADD_FAILURE();
  } catch (const std::logic_error& e) {
    EXPECT_NE(std::string(e.what()).find("isCloserThan"), std::string::npos) << e.what();
  }
}

TYPED_TEST(Validate, LeavesPairsWithoutModelsToFcl) {
  using S = TypeParam;
  const fcl::Sphere<S> ball(S(1));
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  X.linear() *= S(3);
  this->collision.gjk_tolerance = S(-1);
  EXPECT_EQ(this->collide(&ball, X, &ball, X), 1u);
  EXPECT_NO_THROW(this->distance(&ball, X, &ball, X));
}

}  // namespace
}  // namespace bocst
