// SPDX-License-Identifier: BSD-3-Clause
// Usage: bocst_octree_benchmark MESHES_DIR LINKS_DIR [RESOLUTION [SEED]]
// The links of an arm (OBJ files, see tools/make-models --arm) in random poses among scans (OFF files) and boards,
// which are one octomap of cells of RESOLUTION (0.025), as a planner with a depth camera has it: bocst::Model beside
// BVHModel<OBBRSS>, both with their trees built, in turns of 500 pairs. Prints times of single pairs in us, and FCL's
// time / bocst's, and compares all verdicts. It leaves out the broad phase, and maps that change.
#include <bocst/bocst.h>
#include <bocst/io.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/octree/octree.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace bocst;
using Clock = std::chrono::steady_clock;
using Bvh = fcl::BVHModel<fcl::OBBRSSd>;

/// Points on the surface, at most half a cell apart, of a mesh that is made `size` long and put at a place.
void addSurface(const std::string& file, double size, const Eigen::Vector3d& at, double resolution,
                octomap::Pointcloud& points) {
  const std::shared_ptr<const Mesh> mesh = loadMesh(file);
  const Eigen::AlignedBox3d box = mesh->bounds();
  const double scale = size / box.sizes().maxCoeff();
  for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
    Eigen::Vector3d v[3];
    for (std::size_t k = 0; k < 3; ++k) v[k] = (mesh->vertex(mesh->indices(t)[k]) - box.center()) * scale + at;
    const double longest = std::max({(v[1] - v[0]).norm(), (v[2] - v[1]).norm(), (v[0] - v[2]).norm()});
    const int steps = std::max(1, static_cast<int>(std::ceil(2 * longest / resolution)));
    for (int i = 0; i <= steps; ++i) {
      for (int j = 0; i + j <= steps; ++j) {
        const Eigen::Vector3d p = v[0] + (v[1] - v[0]) * i / steps + (v[2] - v[0]) * j / steps;
        points.push_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
      }
    }
  }
}

void addBoard(double x, double y, double z, const Eigen::Vector2d& half, double resolution,
              octomap::Pointcloud& points) {
  for (double u = -half.x(); u <= half.x(); u += resolution / 2) {
    for (double v = -half.y(); v <= half.y(); v += resolution / 2) {
      points.push_back(static_cast<float>(x + u), static_cast<float>(y + v), static_cast<float>(z));
    }
  }
}

/// With the free cells that a camera at (0, 0, 0.6) sees before the surfaces.
std::shared_ptr<octomap::OcTree> mapOf(const std::string& meshes, double resolution) {
  octomap::Pointcloud points;
  addSurface(meshes + "/armadillo.off", 0.6, {0.6, 0.3, 0.3}, resolution, points);
  addSurface(meshes + "/ChineseDragon-10kv.off", 0.5, {-0.5, 0.5, 0.3}, resolution, points);
  addSurface(meshes + "/boeing.off", 0.8, {0.2, -0.7, 0.4}, resolution, points);
  for (const double z : {0.0, 0.35, 0.7}) addBoard(0, 0.8, z, {0.6, 0.2}, resolution, points);
  addBoard(0, 0, -0.05, {1, 1}, resolution, points);
  auto map = std::make_shared<octomap::OcTree>(resolution);
  map->insertPointCloud(points, octomap::point3d(0, 0, 0.6f), -1, false, true);
  for (const octomap::point3d& point : points) map->updateNode(point, true, true);
  map->updateInnerOccupancy();
  map->prune();
  return map;
}

std::shared_ptr<Bvh> bvhOf(const Mesh& mesh) {
  std::vector<fcl::Triangle> triangles;
  for (std::size_t t = 0; t < mesh.triangleCount(); ++t) triangles.push_back(mesh.triangle(t));
  auto bvh = std::make_shared<Bvh>();
  bvh->beginModel();
  bvh->addSubModel(mesh.vertices(), triangles);
  bvh->endModel();
  bvh->computeLocalAABB();
  return bvh;
}

struct Link {
  std::shared_ptr<const Mesh> mesh;
  std::shared_ptr<Modeld> model;
  std::shared_ptr<Bvh> bvh;
};

struct Sample {
  const Link* link;
  fcl::Transform3d X_WL;
};

/// Times of both sides, and whether the pairs collide.
struct Times {
  std::vector<double> fcl, bocst;
  std::vector<bool> hit;
  std::size_t mismatches = 0;
};

template <typename Query>
Times inTurns(const std::vector<Sample>& samples, const Query& query) {
  constexpr std::size_t kTurn = 500;
  Times times;
  times.fcl.resize(samples.size());
  times.bocst.resize(samples.size());
  std::vector<double> theirs(samples.size()), ours(samples.size());
  const auto ask = [&query](const fcl::CollisionGeometryd& link, const Sample& s, double& us) {
    const Clock::time_point start = Clock::now();
    const double answer = query(link, s.X_WL);
    us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    return answer;
  };
  for (int round = 0; round < 2; ++round) {  // the first warms up
    for (std::size_t begin = 0; begin < samples.size(); begin += kTurn) {
      const std::size_t end = std::min(begin + kTurn, samples.size());
      for (std::size_t i = begin; i < end; ++i) theirs[i] = ask(*samples[i].link->bvh, samples[i], times.fcl[i]);
      for (std::size_t i = begin; i < end; ++i) ours[i] = ask(*samples[i].link->model, samples[i], times.bocst[i]);
    }
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    times.hit.push_back(theirs[i] <= 0);
    times.mismatches += (theirs[i] <= 0) != (ours[i] <= 0) || std::abs(theirs[i] - ours[i]) > 1e-6;
  }
  return times;
}

void print(const char* what, const Times& times, int which) {
  std::vector<double> theirs, ours;
  std::size_t slower = 0;
  for (std::size_t i = 0; i < times.hit.size(); ++i) {
    if (which != 2 && int{times.hit[i]} != which) continue;
    theirs.push_back(times.fcl[i]);
    ours.push_back(times.bocst[i]);
    slower += times.bocst[i] > times.fcl[i];
  }
  if (theirs.empty()) return;
  const std::size_t n = theirs.size();
  double sum[2] = {};
  for (std::size_t i = 0; i < n; ++i) {
    sum[0] += theirs[i];
    sum[1] += ours[i];
  }
  std::sort(theirs.begin(), theirs.end());
  std::sort(ours.begin(), ours.end());
  const std::size_t p99 = n * 99 / 100;
  const double count = static_cast<double>(n);
  std::printf("%-24s %6zu %8.1f %7.1f %8.1f %8.1f %7.1f %8.1f %6.2f %6.2f %6.2f %6.1f %%\n", what, n, sum[0] / count,
              theirs[n / 2], theirs[p99], sum[1] / count, ours[n / 2], ours[p99], sum[0] / sum[1],
              theirs[n / 2] / ours[n / 2], theirs[p99] / ours[p99],
              100 * static_cast<double>(slower) / static_cast<double>(n));
}

void run(int argc, char** argv) {
  const double resolution = argc > 3 ? std::atof(argv[3]) : 0.025;
  std::mt19937_64 g(argc > 4 ? std::strtoull(argv[4], nullptr, 10) : 1);
  const std::shared_ptr<octomap::OcTree> map = mapOf(argv[1], resolution);
  const fcl::OcTreed octree{std::shared_ptr<const octomap::OcTree>(map)};
  std::size_t occupied = 0;
  for (auto leaf = map->begin_leafs(); leaf != map->end_leafs(); ++leaf) occupied += map->isNodeOccupied(*leaf);

  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[2])) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() == ".obj" && name != "table" && name != "shelves") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Link> links;
  for (const std::string& file : files) {
    links.push_back({loadMesh(file), nullptr, nullptr});
    links.back().model = std::make_shared<Modeld>(links.back().mesh);
    links.back().model->buildTree();
    links.back().bvh = bvhOf(*links.back().mesh);
  }
  if (links.empty()) throw std::runtime_error(std::string("no OBJ files in ") + argv[2]);

  std::uniform_real_distribution<double> u(-1, 1);
  std::normal_distribution<double> normal;
  std::vector<Sample> samples;
  for (int i = 0; i < 4000; ++i) {
    const Link& link = links[g() % links.size()];
    fcl::Transform3d X_WL = fcl::Transform3d::Identity();
    X_WL.linear() = Eigen::Quaterniond(normal(g), normal(g), normal(g), normal(g)).normalized().toRotationMatrix();
    X_WL.translation() = Eigen::Vector3d(0.9 * u(g), 0.9 * u(g), 0.4 + 0.5 * u(g));
    X_WL.translation() -= X_WL.linear() * link.mesh->bounds().center();
    samples.push_back({&link, X_WL});
  }

  std::printf("%zu links, among %zu occupied cells of %g (%zu leaves of the octomap); times in us\n", links.size(),
              occupied, resolution, map->getNumLeafNodes());
  std::printf("%-24s %6s %8s %7s %8s %8s %7s %8s %6s %6s %6s %8s\n", "", "pairs", "FCL mean", "median", "p99", "bocst",
              "median", "p99", "mean", "median", "p99", "slower");
  const fcl::Transform3d X_WO = fcl::Transform3d::Identity();
  std::size_t mismatches = 0;
  for (const std::size_t contacts : {0, 1, 10}) {
    const fcl::CollisionRequestd request(std::max<std::size_t>(contacts, 1), contacts > 0);
    const Times times = inTurns(samples, [&](const fcl::CollisionGeometryd& link, const fcl::Transform3d& X_WL) {
      fcl::CollisionResultd result;
      return fcl::collide(&link, X_WL, &octree, X_WO, request, result) > 0 ? -1.0 : 1.0;
    });
    mismatches += times.mismatches;
    const std::string what = contacts == 0 ? "yes or no" : std::to_string(contacts) + " contact(s)";
    print((what + ", all").c_str(), times, 2);
    print("    in contact", times, 1);
    print("    apart", times, 0);
  }
  samples.resize(100);  // FCL takes up to 0.1 s for each
  const Times times = inTurns(samples, [&](const fcl::CollisionGeometryd& link, const fcl::Transform3d& X_WL) {
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    return std::max(fcl::distance(&link, X_WL, &octree, X_WO, request, result), 0.0);
  });
  mismatches += times.mismatches;
  print("distance, apart", times, 0);
  std::printf("%zu answers differ\n", mismatches);
  if (mismatches > 0) std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3 || argc > 5) {
    std::fprintf(stderr, "Usage: bocst_octree_benchmark MESHES_DIR LINKS_DIR [RESOLUTION [SEED]]\n");
    return 2;
  }
  try {
    run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
