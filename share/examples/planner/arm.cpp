// SPDX-License-Identifier: BSD-3-Clause
// Usage: arm LINKS SCAN... [--plans N] [--seed N]
//
// Plans with OMPL's RRT-Connect for an arm of seven joints with a hand, among shelves, a table and scans (each scan
// three times, on the shelves). LINKS is the folder that `tools/make-models --arm TRIANGLES LINKS` writes. The same
// plans are made five times, each time in a process of its own with the same seeds:
//   - FCL's managers with fcl::BVHModel<OBBRSS>, as planners do today,
//   - FCL's managers with bocst::Model: only the geometries change,
//   - bocst::Scene, which answers whole states and edges: StateValidityChecker and MotionValidator change,
//   - the latter two with all trees built in the set-up, where otherwise they grow while plans are made.
// Prints the set-up time; then, after the set-up, the time to the first plan, that of all plans and the share of it
// that was checking. Exits with 1 when one of the five finds another plan.

#include <bocst/bocst.h>
#include <bocst/io.h>
#include <bocst/scene.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <ompl/base/MotionValidator.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace ob = ompl::base;
namespace og = ompl::geometric;

namespace {

constexpr unsigned kJoints = 7;
constexpr double kRange = 2.2;      // radians: joints go from -kRange to kRange
constexpr double kStep = 0.02;      // radians: between the states of an edge that are checked
constexpr double kSolveLimit = 60;  // seconds
constexpr std::array<double, kJoints> kLength{0.25, 0.2,  0.28, 0.2,
                                              0.24, 0.14, 0.1};  // metres, as in tools/make-models

using MeshPtr = std::shared_ptr<const bocst::Mesh>;
using Poses = std::vector<fcl::Transform3d>;
using Clock = std::chrono::steady_clock;

double secondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

fcl::Transform3d at(double x, double y, double z, double yaw = 0) {
  return Eigen::Translation3d(x, y, z) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
         Eigen::Isometry3d::Identity();
}

struct Thing {
  MeshPtr mesh;
  fcl::Transform3d X_WT;
};

/// What is planned for: links, and what stands about. Frames: the arm's base is the world, z up, metres.
struct World {
  std::vector<MeshPtr> links;  // seven of the arm, palm, two fingers
  std::vector<Thing> things;

  World(const std::string& folder, const std::vector<std::string>& scans) {
    for (unsigned i = 1; i <= kJoints; ++i)
      links.push_back(bocst::loadMesh(folder + "/link" + std::to_string(i) + ".obj"));
    links.push_back(bocst::loadMesh(folder + "/palm.obj"));
    links.push_back(bocst::loadMesh(folder + "/finger.obj"));
    links.push_back(links.back());
    things.push_back({bocst::loadMesh(folder + "/table.obj"), at(0, 0, 0)});
    const MeshPtr shelves = bocst::loadMesh(folder + "/shelves.obj");
    things.push_back({shelves, at(0.75, 0, 0.6, M_PI / 2)});
    things.push_back({shelves, at(0, 0.8, 0.6)});
    for (std::size_t k = 0; k < scans.size(); ++k) {
      const MeshPtr scan = bocst::loadMesh(scans[k]);
      const MeshPtr fitted = scan->scaledAndPadded(0.3 / scan->bounds().sizes().maxCoeff(), 0);
      for (int board = 0; board < 3; ++board) {
        const double along = 0.25 * std::sin(5.0 * board + 2.0 * static_cast<double>(k)), height = 0.4 * board + 0.15;
        const fcl::Transform3d X = k % 2 == 0 ? at(0.7, along, height, board) : at(along, 0.75, height, board);
        things.push_back({fitted, X * Eigen::Translation3d(-fitted->bounds().center())});
      }
    }
  }

  /// The allowed collisions: links beside each other, and the parts of the hand.
  static bool mayTouch(std::size_t link, std::size_t other) {
    const std::size_t first = std::min(link, other), last = std::max(link, other);
    return last - first <= 1 || (first + 2 >= kJoints && last >= kJoints) || first >= kJoints;
  }

  static void place(const double* joints, fcl::Transform3d* X_WL) {
    fcl::Transform3d X = fcl::Transform3d::Identity();
    for (unsigned i = 0; i < kJoints; ++i) {
      X.rotate(Eigen::AngleAxisd(joints[i], i % 2 == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY()));
      X_WL[i] = X;
      X.translate(kLength[i] * Eigen::Vector3d::UnitZ());
    }
    X_WL[kJoints] = X;
    X_WL[kJoints + 1] = X * Eigen::Translation3d(-0.06, 0, 0.04);
    X_WL[kJoints + 2] = X * Eigen::Translation3d(0.06, 0, 0.04);
  }
};

const double* jointsOf(const ob::State* state) { return state->as<ob::RealVectorStateSpace::StateType>()->values; }

using GeometryPtr = std::shared_ptr<fcl::CollisionGeometryd>;

/// One geometry for each mesh: what stands in several places shares it.
class Geometries {
 public:
  using Make = std::function<GeometryPtr(const MeshPtr&)>;

  explicit Geometries(Make make) : make_(std::move(make)) {}
  const GeometryPtr& of(const MeshPtr& mesh) {
    GeometryPtr& geometry = made_[mesh];
    if (geometry == nullptr) geometry = make_(mesh);
    return geometry;
  }

 private:
  Make make_;
  std::map<MeshPtr, GeometryPtr> made_;
};

GeometryPtr makeModel(const MeshPtr& mesh) { return std::make_shared<bocst::Modeld>(mesh); }

/// A model that keeps its whole tree from the start: no query builds or drops anything.
GeometryPtr makeBuiltModel(const MeshPtr& mesh) {
  bocst::Options options;
  options.ttl = std::chrono::milliseconds(0);
  const auto model = std::make_shared<bocst::Modeld>(mesh, options);
  model->buildTree();
  return model;
}

/// FCL's managers with any geometries: one state at a time.
class Managers {
 public:
  Managers(const World& world, Geometries geometries) : poses_(world.links.size()) {
    for (const MeshPtr& link : world.links) {
      links_.push_back(std::make_unique<fcl::CollisionObjectd>(geometries.of(link)));
    }
    for (const Thing& thing : world.things) {
      things_.push_back(std::make_unique<fcl::CollisionObjectd>(geometries.of(thing.mesh), thing.X_WT));
    }
    for (std::size_t i = 0; i < links_.size(); ++i) {
      links_[i]->setUserData(reinterpret_cast<void*>(i));
      robot_.registerObject(links_[i].get());
    }
    for (const auto& thing : things_) room_.registerObject(thing.get());
    robot_.setup();
    room_.setup();
  }

  bool isFree(const double* joints) {
    World::place(joints, poses_.data());
    for (std::size_t i = 0; i < links_.size(); ++i) {
      links_[i]->setTransform(poses_[i]);
      links_[i]->computeAABB();
    }
    robot_.update();
    bool hit = false;
    robot_.collide(&room_, &hit,
                   [](fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) { return touch(a, b, data); });
    if (hit) return false;
    robot_.collide(&hit, [](fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) {
      const auto number = [](const fcl::CollisionObjectd* o) {
        return reinterpret_cast<std::size_t>(o->getUserData());
      };
      return World::mayTouch(number(a), number(b)) ? false : touch(a, b, data);
    });
    return !hit;
  }

 private:
  static bool touch(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* hit) {
    fcl::CollisionResultd result;
    return *static_cast<bool*>(hit) = fcl::collide(a, b, fcl::CollisionRequestd(), result) > 0;
  }

  std::vector<std::unique_ptr<fcl::CollisionObjectd>> links_, things_;
  fcl::DynamicAABBTreeCollisionManagerd robot_, room_;
  Poses poses_;
};

GeometryPtr makeBvh(const MeshPtr& mesh) {
  std::vector<fcl::Triangle> triangles(mesh->triangleCount());
  for (std::size_t t = 0; t < triangles.size(); ++t) triangles[t] = mesh->triangle(t);
  auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  bvh->beginModel(static_cast<int>(mesh->triangleCount()), static_cast<int>(mesh->vertexCount()));
  bvh->addSubModel(mesh->vertices(), triangles);
  bvh->endModel();
  return bvh;
}

/// All of an edge's states in one question: the same verdict as ob::DiscreteMotionValidator's.
class SceneMotionValidator final : public ob::MotionValidator {
 public:
  SceneMotionValidator(const ob::SpaceInformationPtr& information, const bocst::Scened& scene, double& seconds)
      : MotionValidator(information), scene_(scene), seconds_(seconds) {}

  bool checkMotion(const ob::State* from, const ob::State* to) const override {
    const auto start = Clock::now();
    const std::size_t states = place(from, to);
    const bool is_free = !scene_.anyCollision(poses_.data(), states);
    seconds_ += secondsSince(start);
    return is_free;
  }

  bool checkMotion(const ob::State* from, const ob::State* to,
                   std::pair<ob::State*, double>& last_valid) const override {
    const auto start = Clock::now();
    const std::size_t states = place(from, to), first = scene_.firstCollision(poses_.data(), states);
    seconds_ += secondsSince(start);
    if (first == states) return true;
    last_valid.second = static_cast<double>(first) / static_cast<double>(states);
    if (last_valid.first != nullptr) si_->getStateSpace()->interpolate(from, to, last_valid.second, last_valid.first);
    return false;
  }

 private:
  // The states behind `from`, with `to`.
  std::size_t place(const ob::State* from, const ob::State* to) const {
    const ob::StateSpace& space = *si_->getStateSpace();
    // OMPL counts 0 segments where both states are the same.
    const std::size_t states = std::max(1u, space.validSegmentCount(from, to)), links = scene_.movingCount();
    poses_.resize(states * links);
    ob::State* between = si_->allocState();
    for (std::size_t k = 1; k <= states; ++k) {
      space.interpolate(from, to, static_cast<double>(k) / static_cast<double>(states), between);
      World::place(jointsOf(k == states ? to : between), &poses_[(k - 1) * links]);
    }
    si_->freeState(between);
    return states;
  }

  const bocst::Scened& scene_;
  double& seconds_;
  mutable Poses poses_;
};

struct Outcome {
  double set_up = 0, first_plan = 0, all_plans = 0, checking = 0;  // seconds; checking is part of all_plans
  double length = 0;                                               // of all plans, radians
  long plans = 0, path_states = 0;
};

struct Way {
  const char* name;
  Geometries::Make make;
  bool is_scene;
};

/// Plans from one random free state to the next. `is_free` says of one state; `scene` of edges, where it is given.
void plan(const std::function<bool(const double*)>& is_free, const bocst::Scened* scene, int plans, unsigned seed,
          Outcome& outcome) {
  const auto start = Clock::now();
  const auto space = std::make_shared<ob::RealVectorStateSpace>(kJoints);
  space->setBounds(-kRange, kRange);
  std::mt19937_64 random(seed);
  const auto freeState = [&] {
    ob::ScopedState<> state(space);
    do {
      for (unsigned i = 0; i < kJoints; ++i) state[i] = std::uniform_real_distribution<double>(-kRange, kRange)(random);
    } while (!is_free(jointsOf(state.get())));
    return state;
  };
  ob::ScopedState<> from = freeState();
  for (int k = 0; k < plans; ++k) {
    og::SimpleSetup setup(space);
    const auto information = setup.getSpaceInformation();
    setup.setStateValidityChecker([&](const ob::State* state) {
      const auto begin = Clock::now();
      const bool free = is_free(jointsOf(state));
      outcome.checking += secondsSince(begin);
      return free;
    });
    information->setStateValidityCheckingResolution(kStep / space->getMaximumExtent());
    if (scene != nullptr) {
      information->setMotionValidator(std::make_shared<SceneMotionValidator>(information, *scene, outcome.checking));
    }
    const ob::ScopedState<> to = freeState();
    setup.setStartAndGoalStates(from, to);
    setup.setPlanner(std::make_shared<og::RRTConnect>(information));
    if (setup.solve(kSolveLimit) != ob::PlannerStatus::EXACT_SOLUTION) throw std::runtime_error("no plan");
    outcome.length += setup.getSolutionPath().length();
    outcome.path_states += static_cast<long>(setup.getSolutionPath().getStateCount());
    if (++outcome.plans == 1) outcome.first_plan = secondsSince(start);
    from = to;
  }
  outcome.all_plans = secondsSince(start);
}

Outcome solve(const World& world, const Way& way, int plans, unsigned seed) {
  ompl::RNG::setSeed(seed);
  Outcome outcome;
  const auto start = Clock::now();
  if (way.is_scene) {
    bocst::Scened scene;
    std::vector<bocst::Id> ids;
    Geometries geometries(way.make);
    for (const MeshPtr& link : world.links) ids.push_back(scene.addMoving(geometries.of(link)));
    for (const Thing& thing : world.things) scene.addFixed(geometries.of(thing.mesh), thing.X_WT);
    for (std::size_t i = 0; i < ids.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        if (World::mayTouch(i, j)) scene.ignore(ids[i], ids[j]);
      }
    }
    outcome.set_up = secondsSince(start);
    Poses poses(ids.size());
    const auto is_free = [&](const double* joints) {
      World::place(joints, poses.data());
      return !scene.collides(poses.data());
    };
    plan(is_free, &scene, plans, seed, outcome);
  } else {
    Managers managers(world, Geometries(way.make));
    outcome.set_up = secondsSince(start);
    plan([&](const double* joints) { return managers.isFree(joints); }, nullptr, plans, seed, outcome);
  }
  return outcome;
}

/// In a process of its own, since OMPL takes one seed a process.
Outcome solveInChild(const World& world, const Way& way, int plans, unsigned seed) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process");
  if (child == 0) {
    try {
      const Outcome o = solve(world, way, plans, seed);
      _exit(write(ends[1], &o, sizeof o) == static_cast<ssize_t>(sizeof o) ? 0 : 1);
    } catch (const std::exception& e) {
      std::fprintf(stderr, "arm: %s\n", e.what());
      _exit(1);
    }
  }
  close(ends[1]);
  Outcome o;
  const bool complete = read(ends[0], &o, sizeof o) == static_cast<ssize_t>(sizeof o);
  close(ends[0]);
  waitpid(child, nullptr, 0);
  if (!complete) throw std::runtime_error("a planner ended without an answer");
  return o;
}

int run(const std::vector<std::string>& arguments) {
  std::vector<std::string> files;
  int plans = 30, seed = 1;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    if ((arguments[i] == "--plans" || arguments[i] == "--seed") && i + 1 < arguments.size()) {
      int& number = arguments[i] == "--plans" ? plans : seed;
      number = std::stoi(arguments[++i]);
    } else {
      files.push_back(arguments[i]);
    }
  }
  if (files.empty() || plans < 1 || seed < 1) {
    std::fprintf(stderr, "usage: arm LINKS SCAN... [--plans N] [--seed N]\n");
    return 2;
  }
  ompl::msg::setLogLevel(ompl::msg::LOG_ERROR);
  const World world(files[0], {files.begin() + 1, files.end()});
  std::size_t triangles = 0, about = 0;
  for (const MeshPtr& link : world.links) triangles += link->triangleCount();
  for (const Thing& thing : world.things) about += thing.mesh->triangleCount();
  std::printf("arm: %zu links of %zu triangles, among %zu things of %zu triangles; %d plans\n\n", world.links.size(),
              triangles, world.things.size(), about, plans);
  std::printf("%-42s %10s %12s %12s %10s %9s\n", "", "set-up", "first plan", "all plans", "checking", "speed");
  const Way ways[] = {{"FCL's managers, fcl::BVHModel", makeBvh, false},
                      {"FCL's managers, bocst::Model", makeModel, false},
                      {"FCL's managers, bocst::Model, trees built", makeBuiltModel, false},
                      {"bocst::Scene", makeModel, true},
                      {"bocst::Scene, trees built", makeBuiltModel, true}};
  Outcome fcl;
  bool same = true;
  for (const Way& way : ways) {
    const Outcome o = solveInChild(world, way, plans, static_cast<unsigned>(seed));
    if (&way == ways) fcl = o;
    std::printf("%-42s %7.1f ms %9.1f ms %9.1f ms %8.0f %% %7.2f x\n", way.name, o.set_up * 1e3, o.first_plan * 1e3,
                o.all_plans * 1e3, 100 * o.checking / o.all_plans, fcl.all_plans / o.all_plans);
    same = same && o.length == fcl.length && o.path_states == fcl.path_states;
  }
  std::printf("\n%s: %ld states, %.4f rad\n", same ? "the same plans" : "THE PLANS DIFFER", fcl.path_states,
              fcl.length);
  return same ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& e) {
    std::fprintf(stderr, "arm: %s\n", e.what());
    return 2;
  }
}
