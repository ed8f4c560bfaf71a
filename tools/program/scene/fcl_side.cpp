// SPDX-License-Identifier: BSD-3-Clause
// FCL's trees and managers; no bocst overload is in sight here, see pairs/fcl_pair.cpp.
#include <bocst/fcl_templates.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>

#include <algorithm>
#include <limits>

#include "cli/report.h"
#include "pairs/fcl_tree.h"
#include "scene/scene_side.h"
#include "scene/solids.h"

namespace bocst::program {
namespace {

/// FCL's managers over all bodies, one of what moves and one of what does not.
template <typename S>
class Managers {
 public:
  using Geometry = fcl::CollisionGeometry<S>;

  /// @param geometries of bodies.shapes.
  Managers(const Bodies& bodies, const std::vector<std::shared_ptr<Geometry>>& geometries) : bodies_(bodies) {
    for (std::size_t i = 0; i < bodies.bodies.size(); ++i) {
      objects_.push_back(std::make_unique<fcl::CollisionObject<S>>(geometries[bodies.bodies[i].shape]));
      fcl::CollisionObject<S>& object = *objects_.back();
      if (i >= bodies.moving) place(object, bodies.X_WB[i - bodies.moving].cast<S>());
      object.setUserData(const_cast<Bodies::Body*>(&bodies.bodies[i]));
      (i < bodies.moving ? moving_ : fixed_).registerObject(&object);
    }
    moving_.setup();
    fixed_.setup();
  }

  /// @param X_WB of each moving body. @return up to `limit` pairs that collide.
  std::vector<BodyPair> collisions(const fcl::Transform3<S>* X_WB, std::size_t limit) {
    for (std::size_t i = 0; i < bodies_.moving; ++i) place(*objects_[i], X_WB[i]);
    moving_.update();
    Search search{bodies_, limit, {}};
    moving_.collide(&search, look);
    if (search.found.size() < limit && !fixed_.empty()) moving_.collide(&fixed_, &search, look);
    return std::move(search.found);
  }

 private:
  struct Search {
    const Bodies& bodies;
    std::size_t limit;
    std::vector<BodyPair> found;

    std::size_t indexOf(const fcl::CollisionObject<S>& object) const {
      return static_cast<std::size_t>(static_cast<const Bodies::Body*>(object.getUserData()) - bodies.bodies.data());
    }
  };

  static void place(fcl::CollisionObject<S>& object, const fcl::Transform3<S>& X) {
    object.setTransform(X);
    object.computeAABB();
  }

  /// In the order that bocst::Scene has.
  static bool look(fcl::CollisionObject<S>* o1, fcl::CollisionObject<S>* o2, void* data) {
    Search& search = *static_cast<Search*>(data);
    std::size_t a = search.indexOf(*o1), b = search.indexOf(*o2);
    if (a > b) {
      std::swap(a, b);
      std::swap(o1, o2);
    }
    if (!search.bodies.asked(a, b)) return false;
    const fcl::CollisionRequest<S> request;
    fcl::CollisionResult<S> result;
    const Geometry* g1 = o1->collisionGeometry().get();
    const Geometry* g2 = o2->collisionGeometry().get();
    fcl::collide(g1, o1->getTransform(), g2, o2->getTransform(), request, result);
    if (result.isCollision()) search.found.emplace_back(a, b);
    return search.found.size() >= search.limit;
  }

  const Bodies& bodies_;
  std::vector<std::unique_ptr<fcl::CollisionObject<S>>> objects_;
  fcl::DynamicAABBTreeCollisionManager<S> moving_, fixed_;
};

template <typename S>
std::shared_ptr<fcl::CollisionGeometry<S>> geometryOf(const Shape& shape) {
  if (shape.kind != Shape::Kind::kMesh) return solidOf<S>(shape);
  return buildFclTree<fcl::OBBRSS<S>>(MeshArrays(*shape.mesh, Scalar::kDouble));
}

template <typename S>
std::vector<std::shared_ptr<fcl::CollisionGeometry<S>>> geometriesOf(const Bodies& bodies) {
  std::vector<std::shared_ptr<fcl::CollisionGeometry<S>>> geometries;
  for (const Shape& shape : bodies.shapes) geometries.push_back(geometryOf<S>(shape));
  return geometries;
}

template <typename S>
class FclSide final : public SceneSide {
 public:
  FclSide(const Bodies& bodies, const std::vector<Eigen::Isometry3d>& poses)
      : bodies_(bodies), poses_(poses, bodies.moving), managers_(bodies, geometriesOf<S>(bodies)) {}

  std::vector<std::uint8_t> collisions() override {
    std::vector<std::uint8_t> hit(poses_.states());
    Progress progress("FCL: state", hit.size());
    for (std::size_t k = 0; k < hit.size(); ++k) {
      hit[k] = !managers_.collisions(poses_.state(k), 1).empty();
      progress.step();
    }
    return hit;
  }

  std::vector<BodyPair> pairs(std::size_t state) override {
    std::vector<BodyPair> found = managers_.collisions(poses_.state(state), std::numeric_limits<std::size_t>::max());
    std::sort(found.begin(), found.end());
    return found;
  }

  std::size_t bytes() const override {
    std::size_t sum = 0;
    for (const Shape& shape : bodies_.shapes) {
      if (shape.mesh == nullptr) continue;
      sum += fclTreeBytes(sizeof(S) == sizeof(float) ? Scalar::kFloat : Scalar::kDouble, shape.mesh->triangleCount());
    }
    return sum;
  }

 private:
  const Bodies& bodies_;
  ScenePoses<S> poses_;
  Managers<S> managers_;
};

}  // namespace

std::unique_ptr<SceneSide> makeFclSide(Scalar scalar, const Bodies& bodies,
                                       const std::vector<Eigen::Isometry3d>& poses) {
  if (scalar == Scalar::kFloat) return std::make_unique<FclSide<float>>(bodies, poses);
  return std::make_unique<FclSide<double>>(bodies, poses);
}

}  // namespace bocst::program
