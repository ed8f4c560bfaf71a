// SPDX-License-Identifier: BSD-3-Clause
// Usage: planner WALL BODY [SEED]
//
// Plans the way of a rigid body through the opening of a wall with OMPL's RRT-Connect in SE(3), twice with the same
// seed: each state is checked by fcl::collide, first between two fcl::BVHModel<OBBRSS>, then between two bocst models.
// Prints how long it takes from the meshes in memory to the first plan, and what the geometries then hold, with the
// meshes. Exits with 1 when the two disagree about a single state or find no plan.

#include <bocst/bocst.h>
#include <bocst/io.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <malloc.h>
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/SE3StateSpace.h>
#include <ompl/geometric/SimpleSetup.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

namespace ob = ompl::base;
namespace og = ompl::geometric;

namespace {

using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;
using Seconds = std::chrono::duration<double>;

struct Task {
  std::shared_ptr<const bocst::Mesh> wall, body;
  std::uint32_t seed;
};

enum class Kind { kBvh, kBocst };

/// A state that the planner asked about, and the answer.
struct Verdict {
  double state[7];  // position, quaternion (x, y, z, w)
  std::uint64_t is_free;
};

struct Outcome {
  double set_up = 0, first_plan = 0;  // seconds, both from the meshes in memory
  std::uint64_t bytes = 0;            // what the geometries hold in the end, with the meshes
  std::uint64_t has_plan = 0, states_on_path = 0;
  std::vector<Verdict> verdicts;
};

Geometry makeBvh(const bocst::Mesh& mesh) {
  std::vector<fcl::Triangle> triangles(mesh.triangleCount());
  for (std::size_t t = 0; t < triangles.size(); ++t) triangles[t] = mesh.triangle(t);
  auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  bvh->beginModel(static_cast<int>(mesh.triangleCount()), static_cast<int>(mesh.vertexCount()));
  bvh->addSubModel(mesh.vertices(), triangles);
  bvh->endModel();
  return bvh;
}

std::size_t heapBytes() {
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// A position that the middle of the body's box takes, turned as given.
ob::ScopedState<ob::SE3StateSpace> stateAt(const ob::StateSpacePtr& space, const bocst::Mesh& body,
                                           const Eigen::Vector3d& middle, const Eigen::Quaterniond& q) {
  const Eigen::Vector3d p = middle - q * body.bounds().center();
  ob::ScopedState<ob::SE3StateSpace> state(space);
  state->setXYZ(p.x(), p.y(), p.z());
  state->rotation().x = q.x();
  state->rotation().y = q.y();
  state->rotation().z = q.z();
  state->rotation().w = q.w();
  return state;
}

Outcome plan(const Task& task, Kind kind) {
  Outcome outcome;
  ompl::RNG::setSeed(task.seed);
  const auto start_time = std::chrono::steady_clock::now();
  const std::size_t before = heapBytes();
  Geometry wall, body;
  std::shared_ptr<bocst::Modeld> models[2];
  if (kind == Kind::kBvh) {
    wall = makeBvh(*task.wall);
    body = makeBvh(*task.body);
  } else {
    wall = models[0] = std::make_shared<bocst::Modeld>(task.wall);
    body = models[1] = std::make_shared<bocst::Modeld>(task.body);
  }
  const std::size_t built = heapBytes() - before;
  outcome.set_up = Seconds(std::chrono::steady_clock::now() - start_time).count();

  // The wall stands across x. The body starts on one side, turned in some way, and ends on the other, turned otherwise.
  const Eigen::AlignedBox3d& w = task.wall->bounds();
  const double reach = task.body->bounds().diagonal().norm() / 2, clearance = reach + w.sizes().x() / 2;
  const auto space = std::make_shared<ob::SE3StateSpace>();
  ob::RealVectorBounds bounds(3);
  for (unsigned k = 0; k < 3; ++k) {
    const double half = k == 0 ? 2 * clearance : (w.sizes()[k] - 2 * reach) / 2;
    bounds.setLow(k, w.center()[k] - half);
    bounds.setHigh(k, w.center()[k] + half);
  }
  space->setBounds(bounds);

  const fcl::CollisionObjectd wall_object(wall);
  fcl::CollisionObjectd body_object(body);
  og::SimpleSetup setup(space);
  setup.setStateValidityChecker([&](const ob::State* state) {
    const auto& s = *state->as<ob::SE3StateSpace::StateType>();
    const auto& q = s.rotation();
    body_object.setTransform(Eigen::Quaterniond(q.w, q.x, q.y, q.z).toRotationMatrix(),
                             Eigen::Vector3d(s.getX(), s.getY(), s.getZ()));
    fcl::CollisionResultd result;
    const bool is_free = fcl::collide(&wall_object, &body_object, fcl::CollisionRequestd(), result) == 0;
    outcome.verdicts.push_back({{s.getX(), s.getY(), s.getZ(), q.x, q.y, q.z, q.w}, is_free});
    return is_free;
  });
  setup.getSpaceInformation()->setStateValidityCheckingResolution(0.005);
  const Eigen::Vector3d aside(1.5 * clearance, 0, 0);
  setup.setStartAndGoalStates(stateAt(space, *task.body, w.center() - aside, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)),
                              stateAt(space, *task.body, w.center() + aside,
                                      Eigen::Quaterniond(Eigen::AngleAxisd(2, Eigen::Vector3d::UnitY()))));
  setup.setPlanner(std::make_shared<og::RRTConnect>(setup.getSpaceInformation()));
  outcome.has_plan = setup.solve(120.0) == ob::PlannerStatus::EXACT_SOLUTION;
  outcome.first_plan = Seconds(std::chrono::steady_clock::now() - start_time).count();
  outcome.bytes = built;
  for (const auto& model : models) {
    if (model) outcome.bytes += model->statistics().resident_bytes + model->statistics().mesh_bytes;
  }
  if (outcome.has_plan) outcome.states_on_path = setup.getSolutionPath().getStateCount();
  return outcome;
}

void write(int fd, const void* data, std::size_t size) {
  const char* p = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t n = ::write(fd, p, size);
    if (n <= 0) throw std::runtime_error("cannot write to a pipe");
    p += n;
    size -= static_cast<std::size_t>(n);
  }
}

void read(int fd, void* data, std::size_t size) {
  char* p = static_cast<char*>(data);
  while (size > 0) {
    const ssize_t n = ::read(fd, p, size);
    if (n <= 0) throw std::runtime_error("a planner ended without an answer");
    p += n;
    size -= static_cast<std::size_t>(n);
  }
}

/// In a process of its own, since OMPL takes one seed a process.
Outcome planInChild(const Task& task, Kind kind) {
  int ends[2];
  if (pipe(ends) != 0) throw std::runtime_error("no pipe");
  const pid_t child = fork();
  if (child < 0) throw std::runtime_error("no process");
  if (child == 0) {
    const Outcome o = plan(task, kind);
    const std::uint64_t count = o.verdicts.size();
    write(ends[1], &o.set_up, sizeof o.set_up);
    write(ends[1], &o.first_plan, sizeof o.first_plan);
    write(ends[1], &o.bytes, sizeof o.bytes);
    write(ends[1], &o.has_plan, sizeof o.has_plan);
    write(ends[1], &o.states_on_path, sizeof o.states_on_path);
    write(ends[1], &count, sizeof count);
    write(ends[1], o.verdicts.data(), count * sizeof(Verdict));
    _exit(0);
  }
  close(ends[1]);
  Outcome o;
  std::uint64_t count = 0;
  read(ends[0], &o.set_up, sizeof o.set_up);
  read(ends[0], &o.first_plan, sizeof o.first_plan);
  read(ends[0], &o.bytes, sizeof o.bytes);
  read(ends[0], &o.has_plan, sizeof o.has_plan);
  read(ends[0], &o.states_on_path, sizeof o.states_on_path);
  read(ends[0], &count, sizeof count);
  o.verdicts.resize(count);
  read(ends[0], o.verdicts.data(), count * sizeof(Verdict));
  close(ends[0]);
  waitpid(child, nullptr, 0);
  return o;
}

bool same(const Verdict& a, const Verdict& b) {
  for (int k = 0; k < 7; ++k) {
    if (a.state[k] != b.state[k]) return false;
  }
  return a.is_free == b.is_free;
}

int run(int argc, char** argv) {
  if (argc < 3 || argc > 4) {
    std::fprintf(stderr, "usage: planner WALL BODY [SEED]\n");
    return 2;
  }
  ompl::msg::setLogLevel(ompl::msg::LOG_ERROR);
  const Task task{bocst::loadMesh(argv[1]), bocst::loadMesh(argv[2]),
                  argc > 3 ? static_cast<std::uint32_t>(std::stoul(argv[3])) : 1};
  std::printf("wall: %zu triangles, body: %zu triangles\n\n", task.wall->triangleCount(), task.body->triangleCount());
  std::printf("%-22s %10s %12s %8s %8s %10s\n", "", "set-up", "first plan", "checks", "free", "memory");
  Outcome outcomes[2];
  const char* names[] = {"fcl::BVHModel<OBBRSS>", "bocst::Model"};
  for (const Kind kind : {Kind::kBvh, Kind::kBocst}) {
    Outcome& o = outcomes[static_cast<int>(kind)] = planInChild(task, kind);
    std::size_t is_free = 0;
    for (const Verdict& v : o.verdicts) is_free += v.is_free;
    std::printf("%-22s %7.2f ms %9.1f ms %8zu %8zu %7.0f kB\n", names[static_cast<int>(kind)], o.set_up * 1e3,
                o.first_plan * 1e3, o.verdicts.size(), is_free, static_cast<double>(o.bytes) / 1e3);
    if (!o.has_plan) {
      std::printf("no plan\n");
      return 1;
    }
  }
  const auto &a = outcomes[0].verdicts, &b = outcomes[1].verdicts;
  std::size_t differ = a.size() != b.size();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) differ += !same(a[i], b[i]);
  std::printf("\n%s; the plan has %llu states\n", differ == 0 ? "same verdict on every state" : "THE TWO DISAGREE",
              static_cast<unsigned long long>(outcomes[1].states_on_path));
  return differ == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "planner: %s\n", e.what());
    return 2;
  }
}
