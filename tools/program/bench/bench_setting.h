// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/options.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pairs/poses.h"
#include "pairs/query_pair.h"

namespace bocst::program {

/// What the command line asks of `bench`.
struct BenchRequest {
  std::string file_a;
  std::string file_b;  ///< Empty: A again.
  std::size_t subdivide = 0;
  std::size_t poses = 1000;
  std::uint64_t seed = 1;
  std::size_t rounds = 5;
  std::size_t frames = 2000;
  bool build_ahead = false;                                          ///< Options::build_ahead, for fresh and planner.
  std::vector<std::size_t> sizes{10000, 100000, 1000000, 10000000};  ///< Of growth.
};

/// The meshes, FCL's trees and the poses that scenarios share. What only some need is made when first asked for.
class BenchSetting {
 public:
  explicit BenchSetting(const BenchRequest& request);

  const BenchRequest& request() const { return request_; }
  const std::shared_ptr<const Mesh>& meshA() const { return mesh_a_; }
  const std::shared_ptr<const Mesh>& meshB() const { return mesh_b_; }
  double triangles() const { return static_cast<double>(mesh_a_->triangleCount() + mesh_b_->triangleCount()); }

  /// New models from arrays, which FCL copies.
  std::unique_ptr<FclPair> makeFcl();

  /// New models from arrays of their own, which they take over, with default options if not given.
  std::unique_ptr<BocstPair> makeBocst(const Options& options = {}) const;

  const FclPair& fcl();                       ///< Shared.
  double fclBuildTime();                      ///< Microseconds, the median of all that were made.
  std::optional<std::size_t> fclHeapBytes();  ///< That the two models hold.

  const std::vector<Eigen::Isometry3d>& firstPoses();  ///< One a round, for first answers.
  const std::vector<Eigen::Isometry3d>& apartPoses();  ///< Up to one a round, that do not touch.
  const std::vector<Pose>& queryPoses();
  const std::vector<Eigen::Isometry3d>& queryTransforms();  ///< X_AB of the same.
  const std::vector<bool>& queryVerdicts();                 ///< FCL's.

  /// How many of the query poses touch; nothing where nobody wanted these.
  std::optional<std::size_t> hits() const;

  std::string oracleName() const;  ///< What new models ask.

 private:
  const MeshArrays& arraysA();
  const MeshArrays& arraysB();
  void buildFcl();
  void drawPoses();

  BenchRequest request_;
  std::shared_ptr<const Mesh> mesh_a_, mesh_b_;
  std::unique_ptr<MeshArrays> a_, b_;
  std::unique_ptr<FclPair> fcl_;
  std::vector<double> fcl_build_times_;
  std::optional<std::size_t> fcl_heap_bytes_;
  std::vector<Eigen::Isometry3d> first_poses_, apart_poses_, query_transforms_;
  std::vector<Pose> query_poses_;
  std::vector<bool> query_verdicts_;
};

/// Asks all, again and again, until the trees have stopped growing. `growth` changes when they grow.
void warmUp(const std::function<std::vector<std::uint64_t>()>& growth, const std::function<void()>& ask);

/// The same of a pair at some poses; whether the two touch, if nothing else.
void warmUp(const BocstPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs,
            const std::function<void(const Eigen::Isometry3d&)>& ask);
void warmUp(const BocstPair& pair, const std::vector<Eigen::Isometry3d>& X_ABs);

}  // namespace bocst::program
