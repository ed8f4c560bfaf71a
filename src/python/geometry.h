// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <cxxabi.h>
#include <fcl/geometry/collision_geometry.h>
#include <pybind11/pybind11.h>

#include <atomic>
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

/// How often this process, or an ancestor of it, was forked from another.
unsigned forks();

/// A shared mutex where a thread that waits to be alone goes before those that come later. In a child after fork(),
/// what threads of the parent held is free.
class FairSharedMutex {
 public:
  FairSharedMutex() = default;
  ~FairSharedMutex() { delete state_.load(); }
  FairSharedMutex(const FairSharedMutex&) = delete;
  FairSharedMutex& operator=(const FairSharedMutex&) = delete;

  void lock_shared() {
    State& s = state();
    { const std::lock_guard<std::mutex> turn(s.turn); }
    s.mutex.lock_shared();
  }
  void unlock_shared() { state().mutex.unlock_shared(); }
  void lock() {
    State& s = state();
    const std::lock_guard<std::mutex> turn(s.turn);
    s.mutex.lock();
  }
  void unlock() { state().mutex.unlock(); }

 private:
  struct State {
    const unsigned at_forks = forks();
    std::mutex turn;
    std::shared_mutex mutex;
  };

  // The parent's is never destroyed in a child: somebody may hold it for ever.
  State& state() {
    State* known = state_.load();
    if (known->at_forks == forks()) return *known;
    auto made = std::make_unique<State>();
    return state_.compare_exchange_strong(known, made.get()) ? *made.release() : *known;
  }

  std::atomic<State*> state_{new State};
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
