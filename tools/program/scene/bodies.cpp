// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <stdexcept>

#include "scene/scene_side.h"

namespace bocst::program {
namespace {

void checkPosition(const std::string& place, const Part& part, const Eigen::Isometry3d& X_WB) {
  if (X_WB.translation().cwiseAbs().maxCoeff() <= kMostLength) return;
  throw std::runtime_error(place + ": " + part.name + ": a coordinate of its position is beyond 1e75");
}

}  // namespace

Bodies::Bodies(const SceneSetup& setup) : parts(setup.partCount()), allowed(parts * parts, false) {
  const std::vector<Eigen::Isometry3d> X_WP = setup.partPoses(setup.states.front());
  for (const bool moves : {true, false}) {
    for (std::size_t p = 0; p < parts; ++p) {
      if (setup.moves(p) != moves) continue;
      for (const PlacedShape& placed : setup.part(p).shapes) {
        const auto same = [&](const Shape& s) { return s.mesh != nullptr && s.mesh == placed.shape.mesh; };
        const auto found = std::find_if(shapes.begin(), shapes.end(), same);
        bodies.push_back({p, static_cast<std::size_t>(found - shapes.begin()), placed.X_PS});
        if (found == shapes.end()) shapes.push_back(placed.shape);
        if (moves) continue;
        X_WB.push_back(X_WP[p] * placed.X_PS);
        checkPosition(setup.file, setup.part(p), X_WB.back());
      }
    }
    if (moves) moving = bodies.size();
  }
  for (std::size_t p = 0; p < parts; ++p) allowed[p * parts + p] = true;
  for (const auto& [a, b] : setup.allowed) allowed[a * parts + b] = allowed[b * parts + a] = true;
}

std::size_t Bodies::pairCount() const {
  std::size_t count = 0;
  for (std::size_t a = 0; a < moving; ++a) {
    for (std::size_t b = a + 1; b < bodies.size(); ++b) count += asked(a, b);
  }
  return count;
}

std::size_t Bodies::triangles() const {
  std::size_t count = 0;
  for (const Body& body : bodies) {
    const std::shared_ptr<const Mesh>& mesh = shapes[body.shape].mesh;
    if (mesh != nullptr) count += mesh->triangleCount();
  }
  return count;
}

std::vector<Eigen::Isometry3d> posesOf(const SceneSetup& setup, const Bodies& bodies) {
  std::vector<Eigen::Isometry3d> poses;
  poses.reserve(setup.states.size() * bodies.moving);
  for (const State& state : setup.states) {
    const std::string place = setup.states_file + ": " + state.place;
    const std::vector<Eigen::Isometry3d> X_WP = setup.partPoses(state);
    for (std::size_t i = 0; i < bodies.moving; ++i) {
      poses.push_back(X_WP[bodies.bodies[i].part] * bodies.bodies[i].X_PB);
      checkPosition(place, setup.part(bodies.bodies[i].part), poses.back());
    }
  }
  return poses;
}

}  // namespace bocst::program
