// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/collision_geometry.h>
#include <pybind11/pybind11.h>

#include <memory>
#include <shared_mutex>
#include <stdexcept>

namespace bocst::python {

/// Held shared by whatever runs without Python's lock and may read an octree, alone by what changes one.
std::shared_mutex& octreeMutex();

/// Gives Python's lock up while it lives. Calls nothing of Python.
class NoGil {
 private:
  const pybind11::gil_scoped_release released_;
  const std::shared_lock<std::shared_mutex> octrees_{octreeMutex()};
};

/// What Python sees as a collision geometry: shares one of FCL's, which a query may need longer than Python does.
class Geometry {
 public:
  explicit Geometry(std::shared_ptr<fcl::CollisionGeometryd> geometry) : geometry_(std::move(geometry)) {}
  virtual ~Geometry() = default;

  /// @throws std::invalid_argument for a BVHModel that is not built yet.
  virtual std::shared_ptr<fcl::CollisionGeometryd> get() const { return geometry_; }

 protected:
  std::shared_ptr<fcl::CollisionGeometryd> geometry_;
};

/// bocst::Model as a geometry.
class ModelGeometry : public Geometry {
 public:
  explicit ModelGeometry(std::shared_ptr<Modeld> model) : Geometry(model), model_(std::move(model)) {}
  Modeld& model() const { return *model_; }
  std::shared_ptr<Modeld> shared() const { return model_; }

 private:
  std::shared_ptr<Modeld> model_;
};

/// All queries of this module include <bocst/fcl.h>, so they reach bocst in whatever order libraries were loaded.
std::shared_ptr<Modeld> makeModel(std::shared_ptr<const Mesh> mesh, const Options& options);

void bindFcl(pybind11::module_ m);

}  // namespace bocst::python
