// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/fcl.h>
#include <bocst/model.h>
#include <bocst/scene.h>

#include <algorithm>
#include <unordered_map>

#include "scene/scene_side.h"
#include "scene/solids.h"

namespace bocst::program {
namespace {

/// With float, vertices are those that FCL's side has, too.
std::shared_ptr<const Mesh> rounded(const std::shared_ptr<const Mesh>& mesh, Scalar scalar) {
  if (scalar == Scalar::kDouble) return mesh;
  std::vector<Eigen::Vector3d> vertices = mesh->vertices();
  for (Eigen::Vector3d& v : vertices) v = v.cast<float>().cast<double>();
  return mesh->withVertices(std::move(vertices));
}

template <typename S>
class ModelSide final : public BocstSide {
 public:
  ModelSide(const Bodies& bodies, const std::vector<Eigen::Isometry3d>& poses, const Options& options)
      : bodies_(bodies), poses_(poses, bodies.moving), by_boxes_(options.answer == Answer::kExact) {
    for (const Shape& shape : bodies.shapes) geometries_.push_back(geometryOf(shape, options));
    std::vector<Id> ids;
    for (std::size_t i = 0; i < bodies.bodies.size(); ++i) {
      const std::shared_ptr<fcl::CollisionGeometry<S>>& geometry = geometries_[bodies.bodies[i].shape];
      ids.push_back(i < bodies.moving
                        ? scene_.addMoving(geometry)
                        : scene_.addFixed(geometry, fcl::Transform3<S>(bodies.X_WB[i - bodies.moving].cast<S>())));
      body_of_[ids.back()] = i;
      objects_.emplace_back(geometry);
      if (i >= bodies.moving) place(objects_.back(), bodies.X_WB[i - bodies.moving].cast<S>());
    }
    for (std::size_t a = 0; a < bodies.moving; ++a) {
      for (std::size_t b = a + 1; b < ids.size(); ++b) {
        if (!bodies.asked(a, b)) scene_.ignore(ids[a], ids[b]);
      }
    }
  }

  std::vector<std::uint8_t> collisions() override {
    std::vector<std::uint8_t> hit(poses_.states());
    scene_.collisions(poses_.state(0), hit.size(), hit.data());
    return hit;
  }

  /// Scene stops at the first pair, so each one is asked that comes near.
  std::vector<BodyPair> pairs(std::size_t state) override {
    for (std::size_t i = 0; i < bodies_.moving; ++i) place(objects_[i], poses_.state(state)[i]);
    std::vector<BodyPair> found;
    for (std::size_t a = 0; a < bodies_.moving; ++a) {
      for (std::size_t b = a + 1; b < objects_.size(); ++b) {
        if (!bodies_.asked(a, b) || (by_boxes_ && !near(objects_[a], objects_[b]))) continue;
        if (touch(objects_[a], objects_[b])) found.emplace_back(a, b);
      }
    }
    return found;
  }

  std::size_t bytes() const override {
    std::size_t sum = 0;
    for (const auto& model : models_) sum += model->statistics().resident_bytes;
    return sum;
  }

  void buildTrees() override { scene_.buildTrees(); }

  Clearance clearance(std::size_t state) override {
    Pair nearest;
    Clearance result;
    result.distance = scene_.clearance(poses_.state(state), &nearest);
    if (nearest.a.isValid()) result.nearest = std::minmax(body_of_.at(nearest.a), body_of_.at(nearest.b));
    return result;
  }

  std::string oracleName() const override { return models_.empty() ? "" : models_.front()->oracleName(); }

 private:
  std::shared_ptr<fcl::CollisionGeometry<S>> geometryOf(const Shape& shape, const Options& options) {
    if (shape.kind != Shape::Kind::kMesh) return solidOf<S>(shape);
    const Scalar scalar = sizeof(S) == sizeof(float) ? Scalar::kFloat : Scalar::kDouble;
    models_.push_back(std::make_shared<Model<S>>(rounded(shape.mesh, scalar), options));
    return models_.back();
  }

  static void place(fcl::CollisionObject<S>& object, const fcl::Transform3<S>& X_WB) {
    object.setTransform(X_WB);
    object.computeAABB();
  }

  /// By boxes a little larger than they are: FCL's solvers call a contact what has a tiny gap.
  static bool near(const fcl::CollisionObject<S>& a, const fcl::CollisionObject<S>& b) {
    const fcl::AABB<S>&p = a.getAABB(), &q = b.getAABB();
    const S slack = S(1e-5) + S(1e-3) * std::min((p.max_ - p.min_).norm(), (q.max_ - q.min_).norm());
    return (p.min_.array() <= q.max_.array() + slack).all() && (q.min_.array() <= p.max_.array() + slack).all();
  }

  static bool touch(const fcl::CollisionObject<S>& a, const fcl::CollisionObject<S>& b) {
    const fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    return fcl::collide(&a, &b, request, result) > 0;
  }

  const Bodies& bodies_;
  ScenePoses<S> poses_;
  bool by_boxes_;  ///< The spheres of conservative answers reach out of the boxes.
  std::vector<std::shared_ptr<Model<S>>> models_;
  std::vector<std::shared_ptr<fcl::CollisionGeometry<S>>> geometries_;
  Scene<S> scene_;
  std::unordered_map<Id, std::size_t> body_of_;
  std::vector<fcl::CollisionObject<S>> objects_;  ///< Of all bodies.
};

}  // namespace

std::unique_ptr<BocstSide> makeBocstSide(Scalar scalar, const Bodies& bodies,
                                         const std::vector<Eigen::Isometry3d>& poses, const Options& options) {
  if (scalar == Scalar::kFloat) return std::make_unique<ModelSide<float>>(bodies, poses, options);
  return std::make_unique<ModelSide<double>>(bodies, poses, options);
}

}  // namespace bocst::program
