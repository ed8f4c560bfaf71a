// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <assimp/scene.h>
#include <bocst/bocst.h>

#include <dart/collision/fcl/FCLCollisionDetector.hpp>
#include <dart/collision/fcl/FCLCollisionObject.hpp>
#include <dart/dynamics/MeshShape.hpp>
#include <dart/dynamics/ShapeFrame.hpp>
#include <map>
#include <memory>

// DART's detector, with a bocst::Modeld for each MeshShape. Contacts are bocst's: how DART computes its own (the
// default of setContactPointComputationMethod) reads an fcl::BVHModel. To be called as DART's detector, by one thread
// at a time.
class BocstCollisionDetector : public dart::collision::FCLCollisionDetector {
 public:
  BocstCollisionDetector() { setContactPointComputationMethod(FCL); }
  std::shared_ptr<CollisionDetector> cloneWithoutCollisionObjects() const override {
    return std::make_shared<BocstCollisionDetector>();
  }

 private:
  struct Object : dart::collision::FCLCollisionObject {
    Object(CollisionDetector* detector, const dart::dynamics::ShapeFrame* frame,
           const std::shared_ptr<fcl::CollisionGeometryd>& geometry)
        : FCLCollisionObject(detector, frame, geometry) {}
    using FCLCollisionObject::mFCLCollisionObject;
  };

  std::unique_ptr<dart::collision::CollisionObject> createCollisionObject(
      const dart::dynamics::ShapeFrame* frame) override {
    return std::make_unique<Object>(this, frame, geometryOf(frame->getShape()));
  }
  // Called when a shape has changed.
  void refreshCollisionObject(dart::collision::CollisionObject* object) override {
    auto& fcl_object = static_cast<Object*>(object)->mFCLCollisionObject;
    fcl_object = std::make_unique<fcl::CollisionObjectd>(geometryOf(object->getShape()));
    fcl_object->setUserData(object);
  }
  std::shared_ptr<fcl::CollisionGeometryd> geometryOf(const dart::dynamics::ConstShapePtr& shape) {
    const auto mesh = std::dynamic_pointer_cast<const dart::dynamics::MeshShape>(shape);
    if (mesh == nullptr) return claimFCLCollisionGeometry(shape);
    Known& known = known_[shape.get()];
    auto model = known.model.lock();
    if (model != nullptr && known.version == shape->getVersion()) return model;
    model = std::make_shared<bocst::Modeld>();
    model->beginModel();
    const aiScene& scene = *mesh->getMesh();
    for (unsigned m = 0; m < scene.mNumMeshes; ++m) {
      for (unsigned f = 0; f < scene.mMeshes[m]->mNumFaces; ++f) {
        Eigen::Vector3d corners[3];
        for (int k = 0; k < 3; ++k) {
          const aiVector3D& v = scene.mMeshes[m]->mVertices[scene.mMeshes[m]->mFaces[f].mIndices[k]];
          corners[k] = mesh->getScale().cwiseProduct(Eigen::Vector3d(v.x, v.y, v.z));
        }
        model->addTriangle(corners[0], corners[1], corners[2]);
      }
    }
    model->endModel();
    known = {model, shape->getVersion()};
    return model;
  }

  struct Known {
    std::weak_ptr<bocst::Modeld> model;
    std::size_t version;
  };
  std::map<const dart::dynamics::Shape*, Known> known_;
};
