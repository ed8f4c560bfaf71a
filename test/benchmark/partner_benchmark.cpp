// SPDX-License-Identifier: BSD-3-Clause
// Usage: bocst_partner_benchmark octree|bvh MESHES_DIR LINKS_DIR [SEED [RESOLUTION]]
// The links of an arm (OBJ files, see tools/make-models --arm) in random poses among scans (OFF files) and boards, as
// models beside geometries of FCL. `octree`: the scans are one octomap of cells of RESOLUTION (0.025; only used here),
// as a planner with a depth camera has it. `bvh`: either the links or the scans are models, and the others BVHModels,
// in the pairs whose boxes overlap. FCL's time is that of BVHModel<OBBRSS> in place of the model. Trees are built
// before, and both sides ask in turns of 500 pairs. Prints times of single pairs in us, and FCL's time / bocst's, and
// compares all verdicts and distances. It leaves out the broad phase, and what moves or changes.
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
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace bocst;
using Clock = std::chrono::steady_clock;
using Bvh = fcl::BVHModel<fcl::OBBRSSd>;

/// A mesh that is made `size` long and put at a place.
std::shared_ptr<const Mesh> placed(const std::string& file, double size, const Eigen::Vector3d& at) {
  const std::shared_ptr<const Mesh> mesh = loadMesh(file);
  const Eigen::AlignedBox3d box = mesh->bounds();
  const double scale = size / box.sizes().maxCoeff();
  std::vector<Eigen::Vector3d> vertices = mesh->vertices();
  for (Eigen::Vector3d& v : vertices) v = (v - box.center()) * scale + at;
  std::vector<fcl::Triangle> triangles;
  for (std::size_t t = 0; t < mesh->triangleCount(); ++t) triangles.push_back(mesh->triangle(t));
  return std::make_shared<const Mesh>(std::move(vertices), std::move(triangles));
}

std::vector<std::shared_ptr<const Mesh>> scansOf(const std::string& meshes) {
  return {placed(meshes + "/armadillo.off", 0.6, {0.6, 0.3, 0.3}),
          placed(meshes + "/ChineseDragon-10kv.off", 0.5, {-0.5, 0.5, 0.3}),
          placed(meshes + "/boeing.off", 0.8, {0.2, -0.7, 0.4})};
}

/// Points on the surface, at most half a cell apart.
void addSurface(const Mesh& mesh, double resolution, octomap::Pointcloud& points) {
  for (std::size_t t = 0; t < mesh.triangleCount(); ++t) {
    Eigen::Vector3d v[3];
    for (std::size_t k = 0; k < 3; ++k) v[k] = mesh.vertex(mesh.indices(t)[k]);
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
  for (const auto& scan : scansOf(meshes)) addSurface(*scan, resolution, points);
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

struct Part {
  explicit Part(std::shared_ptr<const Mesh> m)
      : mesh(std::move(m)), model(std::make_shared<Modeld>(mesh)), bvh(bvhOf(*mesh)) {
    model->buildTree();
    model->computeLocalAABB();
  }
  std::shared_ptr<const Mesh> mesh;
  std::shared_ptr<Modeld> model;
  std::shared_ptr<Bvh> bvh;
};

/// A link at X_WL beside another geometry at the origin, as FCL has it and with a model.
struct Sample {
  const fcl::CollisionGeometryd *fcl_link, *fcl_other, *link, *other;
  fcl::Transform3d X_WL;
};

/// Times of both sides, and whether the pairs collide.
struct Times {
  std::vector<double> fcl, bocst;
  std::vector<bool> hit;
  std::size_t mismatches = 0;
};

/// FCL's distances to cells are found by libccd, to its tolerance of 1e-6 or a little more.
constexpr double kSolver = 1e-5;

template <typename Query>
Times inTurns(const std::vector<Sample>& samples, const Query& query) {
  constexpr std::size_t kTurn = 500;
  Times times;
  times.fcl.resize(samples.size());
  times.bocst.resize(samples.size());
  std::vector<double> theirs(samples.size()), ours(samples.size());
  const auto ask = [&query](const fcl::CollisionGeometryd* link, const Sample& s, const fcl::CollisionGeometryd* other,
                            double& us) {
    const Clock::time_point start = Clock::now();
    const double answer = query(link, s.X_WL, other);
    us = std::chrono::duration<double, std::micro>(Clock::now() - start).count();
    return answer;
  };
  for (int round = 0; round < 2; ++round) {  // the first warms up
    for (std::size_t begin = 0; begin < samples.size(); begin += kTurn) {
      const std::size_t end = std::min(begin + kTurn, samples.size());
      for (std::size_t i = begin; i < end; ++i)
        theirs[i] = ask(samples[i].fcl_link, samples[i], samples[i].fcl_other, times.fcl[i]);
      for (std::size_t i = begin; i < end; ++i)
        ours[i] = ask(samples[i].link, samples[i], samples[i].other, times.bocst[i]);
    }
  }
  for (std::size_t i = 0; i < samples.size(); ++i) {
    times.hit.push_back(theirs[i] <= 0);
    times.mismatches += (theirs[i] <= 0) != (ours[i] <= 0) || std::abs(theirs[i] - ours[i]) > kSolver;
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

std::vector<Part> linksIn(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() == ".obj" && name != "table" && name != "shelves") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<Part> links;
  for (const std::string& file : files) links.emplace_back(loadMesh(file));
  if (links.empty()) throw std::runtime_error("no OBJ files in " + folder);
  return links;
}

/// Poses in the room that the scans are in.
fcl::Transform3d randomPose(const Part& link, std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(-1, 1);
  std::normal_distribution<double> normal;
  fcl::Transform3d X_WL = fcl::Transform3d::Identity();
  X_WL.linear() = Eigen::Quaterniond(normal(g), normal(g), normal(g), normal(g)).normalized().toRotationMatrix();
  X_WL.translation() = Eigen::Vector3d(0.9 * u(g), 0.9 * u(g), 0.4 + 0.5 * u(g));
  X_WL.translation() -= X_WL.linear() * link.mesh->bounds().center();
  return X_WL;
}

/// True if the boxes overlap that a broad phase compares.
bool boxesOverlap(const Part& link, const fcl::Transform3d& X_WL, const Part& scan) {
  const fcl::CollisionObjectd one(link.bvh, X_WL), other(scan.bvh);
  return one.getAABB().overlap(other.getAABB());
}

/// Returns how many answers differ.
std::size_t compare(std::vector<Sample> samples, std::size_t distances) {
  std::printf("%-24s %6s %8s %7s %8s %8s %7s %8s %6s %6s %6s %8s\n", "", "pairs", "FCL mean", "median", "p99", "bocst",
              "median", "p99", "mean", "median", "p99", "slower");
  const fcl::Transform3d X_WO = fcl::Transform3d::Identity();
  std::size_t mismatches = 0;
  for (const std::size_t contacts : {0, 1, 10}) {
    const fcl::CollisionRequestd request(std::max<std::size_t>(contacts, 1), contacts > 0);
    const Times times = inTurns(samples, [&](const fcl::CollisionGeometryd* link, const fcl::Transform3d& X_WL,
                                             const fcl::CollisionGeometryd* other) {
      fcl::CollisionResultd result;
      return fcl::collide(link, X_WL, other, X_WO, request, result) > 0 ? -1.0 : 1.0;
    });
    mismatches += times.mismatches;
    const std::string what = contacts == 0 ? "yes or no" : std::to_string(contacts) + " contact(s)";
    print((what + ", all").c_str(), times, 2);
    print("    in contact", times, 1);
    print("    apart", times, 0);
  }
  samples.resize(std::min(samples.size(), distances), samples.front());
  const Times times = inTurns(samples, [&](const fcl::CollisionGeometryd* link, const fcl::Transform3d& X_WL,
                                           const fcl::CollisionGeometryd* other) {
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    return std::max(fcl::distance(link, X_WL, other, X_WO, request, result), 0.0);
  });
  print("distance, apart", times, 0);
  return mismatches + times.mismatches;
}

std::size_t runOctree(const std::string& meshes, const std::vector<Part>& links, std::mt19937_64& g,
                      double resolution) {
  const std::shared_ptr<octomap::OcTree> map = mapOf(meshes, resolution);
  const fcl::OcTreed octree{std::shared_ptr<const octomap::OcTree>(map)};
  std::size_t occupied = 0;
  for (auto leaf = map->begin_leafs(); leaf != map->end_leafs(); ++leaf) occupied += map->isNodeOccupied(*leaf);
  std::vector<Sample> samples;
  for (int i = 0; i < 4000; ++i) {
    const Part& link = links[g() % links.size()];
    samples.push_back({link.bvh.get(), &octree, link.model.get(), &octree, randomPose(link, g)});
  }
  std::printf("%zu links, among %zu occupied cells of %g (%zu leaves of the octomap); times in us\n", links.size(),
              occupied, resolution, map->getNumLeafNodes());
  return compare(samples, 100);  // FCL takes up to a second for each distance
}

std::size_t runBvh(const std::string& meshes, const std::vector<Part>& links, std::mt19937_64& g) {
  std::vector<Part> scans;
  for (const auto& scan : scansOf(meshes)) scans.emplace_back(scan);
  std::vector<Sample> samples[2];
  while (samples[0].size() < 4000) {
    const Part& link = links[g() % links.size()];
    const fcl::Transform3d X_WL = randomPose(link, g);
    for (const Part& scan : scans) {
      if (!boxesOverlap(link, X_WL, scan)) continue;
      samples[0].push_back({link.bvh.get(), scan.bvh.get(), link.model.get(), scan.bvh.get(), X_WL});
      samples[1].push_back({link.bvh.get(), scan.bvh.get(), link.bvh.get(), scan.model.get(), X_WL});
    }
  }
  std::size_t mismatches = 0;
  std::printf("%zu links that are models, scans that are BVHModels; times in us\n", links.size());
  mismatches += compare(samples[0], 1000);
  std::printf("%zu links that are BVHModels, scans that are models\n", links.size());
  return mismatches + compare(samples[1], 1000);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string partner = argc > 1 ? argv[1] : "";
  if (argc < 4 || argc > 6 || (partner != "octree" && partner != "bvh")) {
    std::fprintf(stderr, "Usage: bocst_partner_benchmark octree|bvh MESHES_DIR LINKS_DIR [SEED [RESOLUTION]]\n");
    return 2;
  }
  try {
    std::mt19937_64 g(argc > 4 ? std::strtoull(argv[4], nullptr, 10) : 1);
    const std::vector<Part> links = linksIn(argv[3]);
    const std::size_t mismatches = partner == "bvh"
                                       ? runBvh(argv[2], links, g)
                                       : runOctree(argv[2], links, g, argc > 5 ? std::atof(argv[5]) : 0.025);
    std::printf("%zu answers differ\n", mismatches);
    return mismatches > 0 ? 1 : 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
