// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/options.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "pairs/query_pair.h"
#include "scene/scene_setup.h"

namespace bocst::program {

/// A scene flattened: a body is one shape of a part. Those that move come first.
struct Bodies {
  struct Body {
    std::size_t part;
    std::size_t shape;  ///< Index into `shapes`.
    Eigen::Isometry3d X_PB;
  };

  explicit Bodies(const SceneSetup& setup);

  bool asked(std::size_t a, std::size_t b) const {
    return (a < moving || b < moving) && !allowed[bodies[a].part * parts + bodies[b].part];
  }
  bool meshes(std::size_t a, std::size_t b) const { return isMesh(a) && isMesh(b); }
  bool isMesh(std::size_t body) const { return shapes[bodies[body].shape].kind == Shape::Kind::kMesh; }
  std::size_t pairCount() const;  ///< That are asked about.
  std::size_t triangles() const;  ///< Of all bodies.

  std::vector<Shape> shapes;  ///< Bodies with the same mesh share it.
  std::vector<Body> bodies;
  std::size_t moving = 0;
  std::size_t parts = 0;
  std::vector<bool> allowed;            ///< By two parts.
  std::vector<Eigen::Isometry3d> X_WB;  ///< Of the fixed bodies.
};

/// X_WB of moving body i in state k: [k * moving + i].
std::vector<Eigen::Isometry3d> posesOf(const SceneSetup& setup, const Bodies& bodies);

/// Two bodies, the smaller index first.
using BodyPair = std::pair<std::size_t, std::size_t>;

/// A scene with its states in one of the two libraries.
class SceneSide {
 public:
  SceneSide() = default;
  virtual ~SceneSide() = default;
  SceneSide(const SceneSide&) = delete;
  SceneSide& operator=(const SceneSide&) = delete;

  /// Asks for all states; hit[k] is 1 for those that collide.
  virtual std::vector<std::uint8_t> collisions() = 0;

  /// All pairs that collide in a state, sorted.
  virtual std::vector<BodyPair> pairs(std::size_t state) = 0;

  /// Bytes of the trees.
  virtual std::size_t bytes() const = 0;
};

/// How much room a state has.
struct Clearance {
  double distance = 0;
  std::optional<BodyPair> nearest;  ///< None in a scene without pairs.
};

/// bocst::Scene with models.
class BocstSide : public SceneSide {
 public:
  virtual void buildTrees() = 0;  ///< Scene::buildTrees().
  virtual Clearance clearance(std::size_t state) = 0;
  virtual std::string oracleName() const = 0;  ///< Empty without meshes.
};

// Both sides keep references to their arguments. Geometries are made here, from the same arrays.

std::unique_ptr<BocstSide> makeBocstSide(Scalar scalar, const Bodies& bodies,
                                         const std::vector<Eigen::Isometry3d>& poses, const Options& options);

/// FCL's DynamicAABBTreeCollisionManager with BVHModel<OBBRSS>.
std::unique_ptr<SceneSide> makeFclSide(Scalar scalar, const Bodies& bodies,
                                       const std::vector<Eigen::Isometry3d>& poses);

}  // namespace bocst::program
