// SPDX-License-Identifier: BSD-3-Clause
// Models made by FCL's names: code written for fcl::BVHModel with only the type changed.
#include <bocst/bocst.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/shape/sphere.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
#include <random>
#include <stdexcept>
#include <utility>
#include <vector>

#include "meshes.h"

namespace bocst {
namespace {

template <typename S>
std::vector<fcl::Vector3<S>> pointsOf(const test::Raw& raw) {
  std::vector<fcl::Vector3<S>> points;
  for (const Eigen::Vector3d& v : raw.vertices) points.push_back(v.cast<S>());
  return points;
}

/// As a caller of FCL builds a mesh, in every way that there is: the halves of a sub model, then single triangles.
template <typename Geometry, typename S>
std::shared_ptr<Geometry> build(const test::Raw& raw) {
  auto model = std::make_shared<Geometry>();
  const std::vector<fcl::Vector3<S>> points = pointsOf<S>(raw);
  const std::size_t half = raw.triangles.size() / 2;
  EXPECT_EQ(model->beginModel(static_cast<int>(raw.triangles.size()), static_cast<int>(points.size())), fcl::BVH_OK);
  EXPECT_EQ(model->addVertex(fcl::Vector3<S>(100, 0, 0)), fcl::BVH_OK);  // of no triangle
  EXPECT_EQ(model->addSubModel(points, {raw.triangles.begin(), raw.triangles.begin() + static_cast<long>(half)}),
            fcl::BVH_OK);
  for (std::size_t t = half; t < raw.triangles.size(); ++t) {
    const fcl::Triangle& c = raw.triangles[t];
    EXPECT_EQ(model->addTriangle(points[c[0]], points[c[1]], points[c[2]]), fcl::BVH_OK);
  }
  EXPECT_EQ(model->endModel(), fcl::BVH_OK);
  return model;
}

template <typename S>
fcl::Transform3<S> randomPose(std::mt19937& g, double reach) {
  std::uniform_real_distribution<double> u(-1, 1);
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  X.linear() = Eigen::Quaterniond(u(g), u(g), u(g), u(g)).normalized().toRotationMatrix().cast<S>();
  X.translation() = (reach * Eigen::Vector3d(u(g), u(g), u(g))).cast<S>();
  return X;
}

TEST(Builder, AnswersAsBvhModelBuiltByTheSameCalls) {
  using Bvh = fcl::BVHModel<fcl::OBBRSSd>;
  const test::Raw torus = test::torus(12), box = test::box({-0.4, -0.3, -0.2}, {0.3, 0.4, 0.5});
  const auto a = build<Modeld, double>(torus), b = build<Modeld, double>(box);
  const auto fcl_a = build<Bvh, double>(torus), fcl_b = build<Bvh, double>(box);
  EXPECT_EQ(a->mesh()->triangleCount(), static_cast<std::size_t>(fcl_a->num_tris));
  EXPECT_EQ(a->mesh()->vertexCount(), static_cast<std::size_t>(fcl_a->num_vertices));
  EXPECT_EQ(a->getModelType(), fcl_a->getModelType());
  EXPECT_NEAR(a->computeVolume(), fcl_a->computeVolume(), 1e-9);
  std::mt19937 g(3);
  std::size_t hits = 0;
  for (int i = 0; i < 200; ++i) {
    const fcl::Transform3d X = randomPose<double>(g, 1.5);
    const auto ask = [&X](const fcl::CollisionGeometryd* first, const fcl::CollisionGeometryd* second) {
      fcl::CollisionResultd result;
      const fcl::Transform3d I = fcl::Transform3d::Identity();
      fcl::collide(first, I, second, X, fcl::CollisionRequestd(1000000), result);
      std::vector<std::pair<long, long>> pairs;
      for (std::size_t k = 0; k < result.numContacts(); ++k) {
        pairs.emplace_back(result.getContact(k).b1, result.getContact(k).b2);
      }
      std::sort(pairs.begin(), pairs.end());
      pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
      return pairs;
    };
    const auto ours = ask(a.get(), b.get());
    EXPECT_EQ(ours, ask(fcl_a.get(), fcl_b.get())) << i;
    hits += !ours.empty();
  }
  EXPECT_GT(hits, 20u);
  EXPECT_LT(hits, 180u);
}

TEST(Builder, TakesFloatsToo) {
  const auto model = build<Modelf, float>(test::box({0, 0, 0}, {1, 1, 1}));
  EXPECT_NEAR(model->computeVolume(), 1, 1e-6);
}

TEST(Builder, ReturnsFclsCodeForWhatIsOutOfSequence) {
  // Not compared with FCL: there addTriangle() before beginModel() is accepted, and memory freed twice.
  const std::vector<fcl::Vector3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  Modeld model;
  for (const int code :
       {model.addVertex(points[0]), model.addTriangle(points[0], points[1], points[2]), model.addSubModel(points),
        model.addSubModel(points, {fcl::Triangle(0, 1, 2)}), model.endModel(), model.beginUpdateModel(),
        model.updateVertex(points[0]), model.replaceSubModel(points), model.endUpdateModel()}) {
    EXPECT_EQ(code, fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  }
  EXPECT_EQ(model.beginModel(), fcl::BVH_OK);
  EXPECT_EQ(model.updateVertex(points[0]), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_EQ(model.endModel(), fcl::BVH_ERR_BUILD_EMPTY_MODEL);
  EXPECT_TRUE(model.empty());
  EXPECT_EQ(model.beginModel(), fcl::BVH_OK);
  EXPECT_EQ(model.addSubModel(points, {fcl::Triangle(0, 1, 2)}), fcl::BVH_OK);
  EXPECT_EQ(model.beginUpdateModel(), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_EQ(model.endModel(), fcl::BVH_OK);
  EXPECT_EQ(model.addVertex(points[0]), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_EQ(model.endModel(), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_EQ(model.updateVertex(points[0]), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_EQ(model.endReplaceModel(), fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  EXPECT_FALSE(model.empty());
  EXPECT_EQ(model.beginModel(), fcl::BVH_OK) << "drops the mesh";
  EXPECT_EQ(model.mesh(), nullptr);
}

TEST(Builder, CodesOfFclAreLoggedOnceForASequence) {
  std::vector<std::string> seen;
  setLogger([&seen](LogLevel level, const std::string& message) {
    EXPECT_EQ(level, LogLevel::kError);
    seen.push_back(message);
  });
  const std::vector<fcl::Vector3d> points{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  Modeld model;
  for (int i = 0; i < 3; ++i) model.addSubModel(points, {fcl::Triangle(0, 1, 2)});
  model.endModel();
  model.beginModel();
  model.endModel();
  model.beginUpdateModel();
  model.updateVertex(points[0]);
  model.endUpdateModel();
  model.beginModel();
  model.addSubModel(points, {fcl::Triangle(0, 1, 2)});
  EXPECT_EQ(model.endModel(), fcl::BVH_OK);
  model.beginUpdateModel();
  model.updateVertex(points[0]);
  EXPECT_EQ(model.endUpdateModel(), fcl::BVH_ERR_INCORRECT_DATA);
  setLogger({});
  ASSERT_EQ(seen.size(), 5u);
  EXPECT_EQ(seen[0], "Model::endModel() without beginModel()");
  EXPECT_EQ(seen[1], "Model::endModel() after nothing was added; the model is empty");
  EXPECT_EQ(seen[2], "Model::beginUpdateModel() of an empty model");
  EXPECT_EQ(seen[3], "Model::endUpdateModel() without beginUpdateModel()");
  EXPECT_EQ(seen[4], "Model::endUpdateModel() after 1 positions; the mesh has 3 vertices and keeps its own");
}

TEST(Builder, MovesVertices) {
  const test::Raw raw = test::box({0, 0, 0}, {1, 1, 1});
  Modeld model(raw.mesh());
  std::vector<fcl::Vector3d> points = pointsOf<double>(raw);
  for (fcl::Vector3d& p : points) p.x() += 5;
  EXPECT_EQ(model.beginUpdateModel(), fcl::BVH_OK);
  EXPECT_EQ(model.updateVertex(points[0]), fcl::BVH_OK);
  EXPECT_EQ(model.updateTriangle(points[1], points[2], points[3]), fcl::BVH_OK);
  EXPECT_EQ(model.updateSubModel({points.begin() + 4, points.end()}), fcl::BVH_OK);
  EXPECT_EQ(model.endUpdateModel(true, false), fcl::BVH_OK);
  EXPECT_EQ(model.mesh()->bounds().min().x(), 5);
  EXPECT_NEAR(model.aabb_local.min_.x(), 5, 1e-12);
  EXPECT_EQ(model.beginReplaceModel(), fcl::BVH_OK);
  EXPECT_EQ(model.replaceSubModel({points.begin(), points.begin() + 3}), fcl::BVH_OK);
  EXPECT_EQ(model.endReplaceModel(), fcl::BVH_ERR_INCORRECT_DATA);
  EXPECT_EQ(model.mesh()->bounds().min().x(), 5) << "as before";
}

TEST(Builder, AnEmptyModelTouchesNothing) {
  const auto empty = std::make_shared<Modeld>();
  const auto box = std::make_shared<Modeld>(test::box({-1, -1, -1}, {1, 1, 1}).mesh());
  const auto bvh = build<fcl::BVHModel<fcl::OBBRSSd>, double>(test::box({-1, -1, -1}, {1, 1, 1}));
  const auto sphere = std::make_shared<fcl::Sphered>(1);
  EXPECT_TRUE(empty->empty());
  EXPECT_FALSE(box->empty());
  EXPECT_EQ(empty->mesh(), nullptr);
  EXPECT_EQ(empty->statistics().resident_nodes, 0u);
  EXPECT_EQ(empty->getModelType(), fcl::BVH_MODEL_UNKNOWN);
  EXPECT_THROW(empty->computeVolume(), std::logic_error);
  EXPECT_THROW(empty->updateVertices({}), std::logic_error);
  empty->prune();
  empty->visit([](const NodeView&) { ADD_FAILURE(); });

  const fcl::Transform3d I = fcl::Transform3d::Identity();
  const std::vector<std::shared_ptr<fcl::CollisionGeometryd>> partners{empty, box, bvh, sphere};
  for (const auto& partner : partners) {
    for (const bool first : {false, true}) {
      const fcl::CollisionGeometryd* o1 = first ? empty.get() : partner.get();
      const fcl::CollisionGeometryd* o2 = first ? partner.get() : empty.get();
      fcl::CollisionResultd result;
      EXPECT_EQ(fcl::collide(o1, I, o2, I, fcl::CollisionRequestd(10, true), result), 0u);
      const fcl::detail::GJKSolver_libccd<double> solver;
      EXPECT_EQ(fcl::collide(o1, I, o2, I, &solver, fcl::CollisionRequestd(10, true), result), 0u);
      EXPECT_FALSE(result.isCollision());
      fcl::DistanceResultd distance;
      EXPECT_EQ(fcl::distance(o1, I, o2, I, fcl::DistanceRequestd(true), distance), std::numeric_limits<double>::max());
      fcl::ContinuousCollisionResultd moved;
      moved.is_collide = true;
      fcl::Transform3d end = I;
      end.translation() << 0, 1, 2;
      EXPECT_EQ(fcl::continuousCollide(o1, I, end, o2, I, I, fcl::ContinuousCollisionRequestd(), moved), 1);
      EXPECT_FALSE(moved.is_collide);
      EXPECT_TRUE(moved.contact_tf1.isApprox(end));
      EXPECT_TRUE(moved.contact_tf2.isApprox(I));
    }
  }
  // In a manager, too.
  fcl::CollisionObjectd a(empty), b(box);
  fcl::DynamicAABBTreeCollisionManagerd manager;
  manager.registerObject(&a);
  manager.registerObject(&b);
  manager.setup();
  fcl::DefaultCollisionData<double> data;
  manager.collide(&data, fcl::DefaultCollisionFunction<double>);
  EXPECT_FALSE(data.result.isCollision());
  Scened scene;
  EXPECT_THROW(scene.addMoving(empty), std::invalid_argument);

  empty->setMesh(box->mesh());
  fcl::CollisionResultd result;
  EXPECT_GT(fcl::collide(empty.get(), I, box.get(), I, fcl::CollisionRequestd(), result), 0u);
}

TEST(Builder, AModelThatIsBeingBuiltIsNoGeometry) {
  const auto model = std::make_shared<Modeld>(test::box({-1, -1, -1}, {1, 1, 1}).mesh());
  const fcl::Transform3d I = fcl::Transform3d::Identity();
  fcl::CollisionResultd result;
  EXPECT_EQ(model->beginModel(), fcl::BVH_OK);
  EXPECT_THROW(fcl::collide(model.get(), I, model.get(), I, fcl::CollisionRequestd(), result), std::logic_error);
  fcl::DistanceResultd distance;
  EXPECT_THROW(fcl::distance(model.get(), I, model.get(), I, fcl::DistanceRequestd(), distance), std::logic_error);
  const fcl::Boxd box(1, 1, 1);
  try {
    fcl::collide(&box, I, model.get(), I, fcl::CollisionRequestd(), result);
    ADD_FAILURE();
  } catch (const std::logic_error& e) {
    EXPECT_NE(std::string(e.what()).find("bocst::collide: o2 is a bocst::Model between beginModel()"),
              std::string::npos)
        << e.what();
  }
  EXPECT_EQ(model->addSubModel({{0, 0, 0}, {1, 0, 0}}, {fcl::Triangle(0, 1, 2)}), fcl::BVH_OK);
  EXPECT_THROW(model->endModel(), std::invalid_argument) << "there is no vertex 2";
  EXPECT_TRUE(model->empty());
}

TEST(Builder, TakesABvhModelThatWasNotEnded) {
  const test::Raw raw = test::torus(8);
  fcl::BVHModel<fcl::OBBRSSd> bvh;
  EXPECT_TRUE(Modeld(bvh).empty());
  bvh.beginModel();
  bvh.addSubModel(raw.vertices, raw.triangles);
  EXPECT_EQ(bvh.getNumBVs(), 0) << "no tree was built";
  EXPECT_EQ(Modeld(bvh).mesh()->triangleCount(), raw.triangles.size());
}

TEST(Builder, TakesPlainArrays) {
  const std::vector<double> wide{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0.1};
  const std::vector<float> narrow(wide.begin(), wide.end());
  const std::vector<std::uint32_t> triangles{0, 2, 1, 0, 1, 3};
  const auto a = Mesh::fromArrays(wide.data(), 4, triangles.data(), 2);
  const auto b = Mesh::fromArrays(narrow.data(), 4, triangles.data(), 2);
  EXPECT_EQ(a->vertex(3), Eigen::Vector3d(0, 0, 0.1));
  EXPECT_EQ(b->vertex(3), Eigen::Vector3d(0, 0, double{0.1f}));
  EXPECT_EQ(a->indices(1), (Mesh::Indices{0, 1, 3}));
  EXPECT_THROW(Mesh::fromArrays(wide.data(), 3, triangles.data(), 2), std::invalid_argument);
  EXPECT_THROW(Mesh::fromArrays(static_cast<const double*>(nullptr), 4, triangles.data(), 2), std::invalid_argument);
  EXPECT_THROW(Mesh::fromArrays(wide.data(), 4, nullptr, 2), std::invalid_argument);
}

TEST(Builder, ScalesAndPadsAsGeometricShapesDoes) {
  const test::Raw raw = test::box({1, 2, 3}, {3, 4, 5});
  const auto mesh = raw.mesh();
  const auto larger = mesh->scaledAndPadded(2, 0);
  EXPECT_TRUE(larger->bounds().min().isApprox(Eigen::Vector3d(0, 1, 2), 1e-12));
  EXPECT_TRUE(larger->bounds().max().isApprox(Eigen::Vector3d(4, 5, 6), 1e-12));
  EXPECT_EQ(&larger->triangles(), &mesh->triangles()) << "the indices are shared";
  const auto padded = mesh->scaledAndPadded(1, 0.3);
  for (std::size_t i = 0; i < mesh->vertexCount(); ++i) {
    const Eigen::Vector3d moved = padded->vertex(i) - mesh->vertex(i);
    EXPECT_NEAR(moved.norm(), 0.3, 1e-12);
    EXPECT_NEAR(moved.normalized().dot((mesh->vertex(i) - Eigen::Vector3d(2, 3, 4)).normalized()), 1, 1e-12);
  }
  EXPECT_THROW(mesh->scaledAndPadded(0, 1), std::invalid_argument);
  EXPECT_THROW(mesh->scaledAndPadded(1, std::nan("")), std::invalid_argument);
  // A vertex in the middle stays there.
  EXPECT_EQ(Mesh({{0, 0, 0}}, {fcl::Triangle(0, 0, 0)}).scaledAndPadded(3, 1)->vertex(0), Eigen::Vector3d(0, 0, 0));
}

// A mesh in map coordinates has lost its details in float, one of the same size near its origin has not.
TEST(Builder, AMeshFarFromItsOriginIsReported) {
  std::vector<std::string> seen;
  setLogger([&seen](LogLevel level, const std::string& message) {
    EXPECT_EQ(level, LogLevel::kWarning);
    seen.push_back(message);
  });
  const test::Raw near = test::torus(8), far = test::torus(8).move({5e5, 4e6, 200});
  const Modelf float_near(near.mesh());
  const Modeld double_far(far.mesh());
  EXPECT_TRUE(seen.empty());
  const Modelf float_far(far.mesh());
  ASSERT_EQ(seen.size(), 1u);
  EXPECT_NE(seen[0].find("use double"), std::string::npos) << seen[0];
  Modelf set(near.mesh());
  set.setMesh(far.mesh());
  EXPECT_EQ(seen.size(), 2u);
  setLogger({});
}

}  // namespace
}  // namespace bocst
