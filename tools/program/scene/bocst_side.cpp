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
      : poses_(poses, bodies.moving) {
    for (const Shape& shape : bodies.shapes) geometries_.push_back(geometryOf(shape, options));
    std::vector<Id> ids;
    for (std::size_t i = 0; i < bodies.bodies.size(); ++i) {
      const std::shared_ptr<fcl::CollisionGeometry<S>>& geometry = geometries_[bodies.bodies[i].shape];
      ids.push_back(i < bodies.moving
                        ? scene_.addMoving(geometry)
                        : scene_.addFixed(geometry, fcl::Transform3<S>(bodies.X_WB[i - bodies.moving].cast<S>())));
      body_of_[ids.back()] = i;
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

  std::vector<BodyPair> pairs(std::size_t state) override {
    std::vector<BodyPair> found;
    for (const Pair& pair : scene_.collidingPairs(poses_.state(state))) found.push_back(bodiesOf(pair));
    std::sort(found.begin(), found.end());
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
    if (nearest.a.isValid()) result.nearest = bodiesOf(nearest);
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

  BodyPair bodiesOf(const Pair& pair) const { return std::minmax(body_of_.at(pair.a), body_of_.at(pair.b)); }

  ScenePoses<S> poses_;
  std::vector<std::shared_ptr<Model<S>>> models_;
  std::vector<std::shared_ptr<fcl::CollisionGeometry<S>>> geometries_;
  Scene<S> scene_;
  std::unordered_map<Id, std::size_t> body_of_;
};

}  // namespace

std::unique_ptr<BocstSide> makeBocstSide(Scalar scalar, const Bodies& bodies,
                                         const std::vector<Eigen::Isometry3d>& poses, const Options& options) {
  if (scalar == Scalar::kFloat) return std::make_unique<ModelSide<float>>(bodies, poses, options);
  return std::make_unique<ModelSide<double>>(bodies, poses, options);
}

}  // namespace bocst::program
