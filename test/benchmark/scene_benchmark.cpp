// SPDX-License-Identifier: BSD-3-Clause
// Usage: bocst_scene_benchmark MESHES_DIR [SEED [THREADS [SCENE]]]
// Scene with bocst models against FCL's DynamicAABBTreeCollisionManager with BVHModel<OBBRSS>: an arm of seven links
// among scans (OFF files of the folder), random states, edges, clearance; then among 500 small objects. Both sides take
// turns on the same states; prints times and ratios (above 1: bocst is faster), and compares all verdicts. At the end,
// the same once more for models whose trees are built in the set-up.
#include <bocst/bocst.h>
#include <bocst/io.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/broadphase/default_broadphase_callbacks.h>
#include <fcl/geometry/bvh/BVH_model.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <memory>
#include <set>
#include <string>

#include "conformance/reference.h"

namespace {

using namespace bocst;
using test::Raw;

bool shared = false;  // several threads work, so time is that of the wall and not the thread's own

double now() {
  timespec t;
  clock_gettime(shared ? CLOCK_MONOTONIC : CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Raw readMesh(const std::string& file) {
  const std::shared_ptr<const Mesh> mesh = loadMesh(file);
  Raw raw;
  raw.vertices = mesh->vertices();
  for (std::size_t t = 0; t < mesh->triangleCount(); ++t) raw.triangles.push_back(mesh->triangle(t));
  return raw;
}

/// About the origin, `size` long.
Raw fitted(Raw raw, double size) {
  Eigen::AlignedBox3d box;
  for (const auto& v : raw.vertices) box.extend(v);
  return raw.move(-box.center()).scale(size / box.sizes().maxCoeff());
}

/// A hollow tube along z from 0 to `length`, with a flange at both ends: a profile turned about z.
Raw tube(double radius, double length, std::size_t n) {
  const double pi = std::acos(-1.0);
  std::vector<Eigen::Vector2d> profile;
  for (std::size_t k = 0; k <= n; ++k) {
    const double t = static_cast<double>(k) / static_cast<double>(n);
    const double flange = std::exp(-std::pow((std::abs(t - 0.5) - 0.5) / 0.12, 2.0));
    profile.emplace_back(radius * (0.75 + 0.4 * flange), t * length);
  }
  for (std::size_t k = 0; k <= n / 2; ++k) {
    profile.emplace_back(radius * 0.6, length * (1 - 2 * static_cast<double>(k) / static_cast<double>(n)));
  }
  Raw raw;
  const std::size_t m = profile.size();
  for (std::size_t i = 0; i < n; ++i) {
    const double u = 2 * pi * static_cast<double>(i) / static_cast<double>(n);
    for (const auto& p : profile) raw.vertices.emplace_back(p.x() * std::cos(u), p.x() * std::sin(u), p.y());
    for (std::size_t j = 0; j < m; ++j) {
      const std::size_t a = i * m + j, b = i * m + (j + 1) % m, c = (i + 1) % n * m + j,
                        d = (i + 1) % n * m + (j + 1) % m;
      raw.triangles.emplace_back(a, c, b);
      raw.triangles.emplace_back(b, c, d);
    }
  }
  return raw;
}

/// A plate of many triangles.
Raw plate(double x, double y, double z, std::size_t n) {
  Raw raw;
  for (std::size_t i = 0; i <= n; ++i) {
    for (std::size_t j = 0; j <= n; ++j) {
      const double u = static_cast<double>(i) / static_cast<double>(n) - 0.5,
                   v = static_cast<double>(j) / static_cast<double>(n) - 0.5;
      raw.vertices.emplace_back(x * u, y * v, z / 2);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = 0; j < n; ++j) {
      const std::size_t a = i * (n + 1) + j;
      raw.triangles.emplace_back(a, a + n + 1, a + 1);
      raw.triangles.emplace_back(a + 1, a + n + 1, a + n + 2);
    }
  }
  return raw.add(test::box({-x / 2, -y / 2, -z / 2}, {x / 2, y / 2, 0.4 * z}));
}

constexpr std::size_t kJoints = 7;
using Joints = Eigen::Matrix<double, kJoints, 1>;
using Poses = std::vector<fcl::Transform3d>;

constexpr double kLength[kJoints] = {0.25, 0.2, 0.28, 0.2, 0.24, 0.14, 0.16};

void forward(const Joints& q, fcl::Transform3d* X) {
  fcl::Transform3d at = fcl::Transform3d::Identity();
  for (std::size_t i = 0; i < kJoints; ++i) {
    const Eigen::Vector3d axis = i % 2 == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
    at = at * Eigen::AngleAxisd(q[static_cast<Eigen::Index>(i)], axis);
    X[i] = at;
    at = at * Eigen::Translation3d(0, 0, kLength[i]);
  }
}

Joints randomJoints(std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-2.2, 2.2);
  Joints q;
  for (auto& x : q) x = u(g);
  return q;
}

/// One scene in both worlds.
struct Both {
  std::vector<Raw> links, things;
  Poses X_WT;
  std::set<std::pair<const fcl::CollisionGeometryd*, const fcl::CollisionGeometryd*>> ignored;

  std::vector<std::unique_ptr<fcl::CollisionObjectd>> robot, world;
  fcl::DynamicAABBTreeCollisionManager<double> robot_manager, world_manager;
  std::unique_ptr<Scened> scene;

  void setUp(unsigned threads) {
    double start = now();
    for (const Raw& r : links) robot.push_back(std::make_unique<fcl::CollisionObjectd>(test::bvh<fcl::OBBRSSd>(r)));
    for (std::size_t i = 0; i < things.size(); ++i) {
      world.push_back(std::make_unique<fcl::CollisionObjectd>(test::bvh<fcl::OBBRSSd>(things[i]), X_WT[i]));
    }
    for (auto& o : robot) robot_manager.registerObject(o.get());
    for (auto& o : world) world_manager.registerObject(o.get());
    robot_manager.setup();
    world_manager.setup();
    std::printf("  set-up: FCL %.0f ms", 1e3 * (now() - start));
    for (std::size_t i = 0; i < links.size(); ++i) {
      for (std::size_t j = i + 1; j < links.size() && j <= i + kIgnored; ++j) {
        const auto *a = robot[i]->collisionGeometry().get(), *b = robot[j]->collisionGeometry().get();
        ignored.insert({a, b});
        ignored.insert({b, a});
      }
    }
    makeScene(threads, false);
  }

  // A scene of new models, whose trees are built and kept where `built`.
  void makeScene(unsigned threads, bool built) {
    const double start = now();
    SceneOptions options;
    options.threads = threads;
    scene = std::make_unique<Scened>(options);
    Options of_models;
    if (built) of_models.ttl = std::chrono::milliseconds(0);
    const auto model = [&](const Raw& raw) { return std::make_shared<Modeld>(raw.mesh(), of_models); };
    std::vector<Id> ids;
    for (std::size_t i = 0; i < things.size(); ++i) scene->addFixed(model(things[i]), X_WT[i]);
    for (const Raw& r : links) ids.push_back(scene->addMoving(model(r)));
    if (built) scene->buildTrees();
    std::printf("%s bocst %.1f ms\n", built ? "  set-up with trees built:" : ",", 1e3 * (now() - start));
    for (std::size_t i = 0; i < links.size(); ++i) {
      for (std::size_t j = i + 1; j < links.size() && j <= i + kIgnored; ++j) scene->ignore(ids[i], ids[j]);
    }
  }

  // As an SRDF has them: links that may touch the next ones.
  static constexpr std::size_t kIgnored = 2;

  struct Data {
    const Both* both;
    bool hit = false;
    double distance = std::numeric_limits<double>::max();
  };

  static bool collide(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data) {
    auto& d = *static_cast<Data*>(data);
    if (d.hit) return true;
    if (d.both->ignored.count({a->collisionGeometry().get(), b->collisionGeometry().get()}) != 0) return false;
    const fcl::CollisionRequestd request;
    fcl::CollisionResultd result;
    // The template: FCL must not be timed through bocst's overload.
    d.hit = fcl::collide<double>(a, b, request, result) > 0;
    return d.hit;
  }

  static bool distance(fcl::CollisionObjectd* a, fcl::CollisionObjectd* b, void* data, double& least) {
    auto& d = *static_cast<Data*>(data);
    least = d.distance;
    if (d.both->ignored.count({a->collisionGeometry().get(), b->collisionGeometry().get()}) != 0) return false;
    fcl::DistanceResultd result;
    result.min_distance = d.distance;
    d.distance = std::min(d.distance, std::max(0.0, fcl::distance(a, b, fcl::DistanceRequestd(), result)));
    least = d.distance;
    return least <= 0;
  }

  void place(const fcl::Transform3d* X) {
    for (std::size_t i = 0; i < robot.size(); ++i) {
      robot[i]->setTransform(X[i]);
      robot[i]->computeAABB();
    }
    robot_manager.update();
  }

  bool fclCollides(const fcl::Transform3d* X) {
    place(X);
    Data data{this};
    robot_manager.collide(&world_manager, &data, &collide);
    if (!data.hit) robot_manager.collide(&data, &collide);
    return data.hit;
  }

  double fclClearance(const fcl::Transform3d* X) {
    place(X);
    Data data{this};
    robot_manager.distance(&world_manager, &data, &distance);
    if (data.distance > 0) robot_manager.distance(&data, &distance);
    return data.distance;
  }
};

/// States of an edge in the order of their halving, as planners ask them.
bool fclAny(Both& both, const fcl::Transform3d* X, std::size_t states) {
  std::vector<std::pair<std::size_t, std::size_t>> parts{{0, states}};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [begin, end] = parts[i];
    if (begin == end) continue;
    const std::size_t middle = begin + (end - begin) / 2;
    if (both.fclCollides(X + middle * kJoints)) return true;
    parts.emplace_back(begin, middle);
    parts.emplace_back(middle + 1, end);
  }
  return false;
}

struct Times {
  double fcl = 0, bocst = 0;
  void print(const char* what, std::size_t states, std::size_t hits, std::size_t wrong) const {
    std::printf("  %-28s FCL %9.2f us  bocst %8.2f us  ratio %6.2f  (%.0f %% touch, %zu wrong)\n", what,
                1e6 * fcl / static_cast<double>(states), 1e6 * bocst / static_cast<double>(states), fcl / bocst,
                100.0 * static_cast<double>(hits) / static_cast<double>(states), wrong);
  }
};

// FCL and bocst are asked in long turns, as a planner uses one of them: in short ones each finds its data evicted from
// the caches by the other. For the same reason each answers states, untimed, before a turn, once the trees have grown.
void measure(Both& both, unsigned seed, unsigned threads, bool with_distances) {
  std::mt19937_64 g(seed);
  constexpr std::size_t kStates = 10000, kStatesInTurn = 2000;
  constexpr std::size_t kWarmUp = 1000;
  constexpr int kSettle = 15;
  // First: asked for the first time, so that trees grow. Again: the same states once more. Settled: when nothing grows.
  // New: states that were never asked, of the settled trees.
  Poses X(2 * kStates * kJoints);
  for (std::size_t k = 0; k < 2 * kStates; ++k) forward(randomJoints(g), &X[k * kJoints]);
  std::vector<std::uint8_t> expected(kStates), hit(kStates), warm(kWarmUp);
  bool warms_up = false;
  const auto warmUpFcl = [&] {
    for (std::size_t k = 0; warms_up && k < kWarmUp; ++k) both.fclCollides(&X[k * kJoints]);
  };
  const auto warmUpBocst = [&] {
    if (warms_up) both.scene->collisions(X.data(), kWarmUp, warm.data());
  };
  const auto timeStates = [&](const char* what, const fcl::Transform3d* X_WM) {
    Times times;
    for (std::size_t begin = 0; begin < kStates; begin += kStatesInTurn) {
      const fcl::Transform3d* turn = X_WM + begin * kJoints;
      warmUpFcl();
      double start = now();
      for (std::size_t k = 0; k < kStatesInTurn; ++k) expected[begin + k] = both.fclCollides(turn + k * kJoints);
      times.fcl += now() - start;
      warmUpBocst();
      start = now();
      both.scene->collisions(turn, kStatesInTurn, &hit[begin]);
      times.bocst += now() - start;
    }
    std::size_t hits = 0, wrong = 0;
    for (std::size_t k = 0; k < kStates; ++k) {
      hits += hit[k];
      wrong += hit[k] != expected[k];
    }
    times.print(what, kStates, hits, wrong);
  };
  timeStates("random states", X.data());
  timeStates("random states again", X.data());
  for (int k = 0; k < kSettle; ++k) both.scene->collisions(X.data(), kStates, hit.data());
  warms_up = true;
  timeStates("random states, settled", X.data());
  timeStates("new random states", &X[kStates * kJoints]);

  // Edges as a planner extends its tree: from a free state, up to 1 rad, in steps of 0.02 rad.
  std::vector<std::vector<Joints>> edges;
  std::size_t states = 0;
  const auto addEdges = [&](std::size_t count) {
    edges.clear();
    states = 0;
    Poses one(kJoints);
    while (edges.size() < count) {
      const Joints from = randomJoints(g);
      forward(from, one.data());
      if (both.fclCollides(one.data())) continue;
      Joints displacement = randomJoints(g) - from;
      const double length = std::min(1.0, displacement.norm());
      displacement.normalize();
      std::vector<Joints>& edge = edges.emplace_back();
      for (std::size_t k = 0; k < static_cast<std::size_t>(length / 0.02); ++k)
        edge.push_back(from + 0.02 * static_cast<double>(k + 1) * displacement);
      states += edge.size();
    }
  };
  // Asks about all edges; returns the seconds that the answers took. The poses are computed just before each, untimed.
  const auto askEdges = [&](const auto& ask, std::vector<std::size_t>& answers) {
    double seconds = 0;
    Poses poses;
    for (const std::vector<Joints>& edge : edges) {
      poses.resize(edge.size() * kJoints);
      for (std::size_t k = 0; k < edge.size(); ++k) forward(edge[k], &poses[k * kJoints]);
      const double start = now();
      answers.push_back(ask(poses.data(), edge.size()));
      seconds += now() - start;
    }
    return seconds;
  };
  // `fcl` and `bocst` answer one edge; an answer of 0 is a free edge.
  const auto timeEdges = [&](const char* what, const auto& fcl, const auto& bocst) {
    Times times;
    std::vector<std::size_t> theirs, ours;
    warmUpFcl();
    times.fcl = askEdges(fcl, theirs);
    warmUpBocst();
    times.bocst = askEdges(bocst, ours);
    std::size_t hits = 0, wrong = 0;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      hits += theirs[k] != 0;
      wrong += ours[k] != theirs[k];
    }
    times.print(what, edges.size(), hits, wrong);
  };
  const auto fclHits = [&](const fcl::Transform3d* X_WM, std::size_t count) -> std::size_t {
    return fclAny(both, X_WM, count);
  };
  const auto bocstHits = [&](const fcl::Transform3d* X_WM, std::size_t count) -> std::size_t {
    return both.scene->anyCollision(X_WM, count);
  };
  // States from the first that collides on.
  const auto fclBlocked = [&](const fcl::Transform3d* X_WM, std::size_t count) {
    std::size_t at = 0;
    while (at < count && !both.fclCollides(X_WM + at * kJoints)) ++at;
    return count - at;
  };
  const auto bocstBlocked = [&](const fcl::Transform3d* X_WM, std::size_t count) {
    return count - both.scene->firstCollision(X_WM, count);
  };
  constexpr std::size_t kEdges = 400;
  addEdges(kEdges);
  std::printf("  %zu edges of %zu states:\n", kEdges, states / kEdges);
  timeEdges("edge, any collision", fclHits, bocstHits);
  timeEdges("edge again, any collision", fclHits, bocstHits);
  std::vector<std::size_t> answers;
  for (int k = 0; k < kSettle; ++k) askEdges(bocstHits, answers);
  timeEdges("edge settled, any collision", fclHits, bocstHits);
  addEdges(kEdges);
  timeEdges("new edge, any collision", fclHits, bocstHits);
  timeEdges("edge, first collision", fclBlocked, bocstBlocked);

  both.makeScene(threads, true);
  warms_up = false;
  timeStates("random states, first", X.data());
  timeEdges("edge, any collision", fclHits, bocstHits);

  if (!with_distances) return;
  Times t;
  Poses one(kJoints);
  std::size_t hits = 0, wrong = 0;
  const std::size_t asked = 150;
  for (std::size_t k = 0; k < asked; ++k) {
    forward(randomJoints(g), one.data());
    double start = now();
    const double distance = both.fclClearance(one.data());
    t.fcl += now() - start;
    start = now();
    const double d = both.scene->clearance(one.data());
    t.bocst += now() - start;
    wrong += std::abs(d - distance) > 1e-6;
    hits += distance <= 0;
  }
  t.print("clearance", asked, hits, wrong);
}

void addArm(Both& both, std::size_t n) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    both.links.push_back(tube(0.075 - 0.005 * static_cast<double>(i), kLength[i], n));
    if (i + 1 == kJoints) both.links.back().add(test::torus(n / 2).scale(0.06).move({0, 0, kLength[i]}));
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s MESHES_DIR [SEED [THREADS [SCENE]]]\n", argv[0]);
    return 2;
  }
  const unsigned seed = argc > 2 ? static_cast<unsigned>(std::atoi(argv[2])) : 1;
  const unsigned threads = argc > 3 ? static_cast<unsigned>(std::atoi(argv[3])) : 1;
  shared = threads != 1;
  const int only = argc > 4 ? std::atoi(argv[4]) : 0;
  std::mt19937_64 g(seed);
  std::uniform_real_distribution<double> u(0, 1);

  if (only == 0 || only == 1) {
    std::printf("a dense arm among scans\n");
    Both arm;
    addArm(arm, 80);
    std::set<std::filesystem::path> files;
    for (const auto& entry : std::filesystem::directory_iterator(argv[1])) {
      if (entry.path().extension() == ".off") files.insert(entry.path());
    }
    std::size_t triangles = 0;
    for (int turn = 0; turn < 2; ++turn) {
      for (const auto& file : files) {
        arm.things.push_back(fitted(readMesh(file), 0.3 + 0.3 * u(g)));
        triangles += arm.things.back().triangles.size();
        const double angle = 6.283 * u(g), distance = 0.55 + 0.5 * u(g), height = 1.3 * u(g) - 0.3;
        arm.X_WT.push_back(test::pose<double>(test::randomRotation(g),
                                              {distance * std::cos(angle), distance * std::sin(angle), height}));
      }
    }
    for (const double z : {-0.5, 1.45}) {
      arm.things.push_back(plate(2, 2, 0.04, 100));
      arm.X_WT.push_back(test::pose<double>(Eigen::Matrix3d::Identity(), {0, 0, z}));
    }
    std::printf("  %zu links of %zu triangles, %zu things of %zu triangles in all\n", arm.links.size(),
                arm.links[0].triangles.size(), arm.things.size(), triangles);
    arm.setUp(threads);
    measure(arm, seed, threads, true);
  }
  if (only == 0 || only == 2) {
    std::printf("an arm among 500 small objects\n");
    Both small;
    addArm(small, 40);
    for (int k = 0; k < 500; ++k) {
      small.things.push_back(test::torus(15).scale(0.02 + 0.02 * u(g)));
      const double angle = 6.283 * u(g), distance = 0.3 + 1.0 * u(g), height = 1.8 * u(g) - 0.6;
      small.X_WT.push_back(test::pose<double>(test::randomRotation(g),
                                              {distance * std::cos(angle), distance * std::sin(angle), height}));
    }
    small.setUp(threads);
    measure(small, seed, threads, false);
  }
  return 0;
}
