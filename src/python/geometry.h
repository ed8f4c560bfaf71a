// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <cxxabi.h>
#include <fcl/geometry/collision_geometry.h>
#include <pybind11/pybind11.h>

#include <chrono>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <thread>

namespace bocst::python {

/// Returns f(), which may run Python's code. A daemon thread that Python ends in there because the process exits
/// pauses: unwinding would release objects without the GIL. f itself holds no objects.
template <typename F>
auto pauseAtExit(const F& f) {
  try {
    return f();
  } catch (const abi::__forced_unwind&) {
    for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
  }
}

/// Releases the GIL while it lives. pybind11's own ends the process if Python ends the thread in the destructor.
class NoGil {
 public:
  NoGil() = default;
  NoGil(const NoGil&) = delete;
  NoGil& operator=(const NoGil&) = delete;
  ~NoGil() {
    pauseAtExit([this] { PyEval_RestoreThread(state_); });
  }

 private:
  PyThreadState* const state_ = PyEval_SaveThread();
};

/// A shared mutex where a thread that waits to be alone goes before those that come later.
class FairSharedMutex {
 public:
  void lock_shared() {
    { const std::lock_guard<std::mutex> turn(turn_); }
    mutex_.lock_shared();
  }
  void unlock_shared() { mutex_.unlock_shared(); }
  void lock() {
    const std::lock_guard<std::mutex> turn(turn_);
    mutex_.lock();
  }
  void unlock() { mutex_.unlock(); }

 private:
  std::mutex turn_;
  std::shared_mutex mutex_;
};

/// Held shared by whatever runs without Python's lock and may read an octree, alone by what changes one.
FairSharedMutex& octreeMutex();

/// The same where octrees may be read. Calls nothing of Python.
class NoGilWithOctrees {
 private:
  const NoGil released_{};
  const std::shared_lock<FairSharedMutex> octrees_{octreeMutex()};
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
