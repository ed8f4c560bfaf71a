// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pairs/poses.h"

namespace bocst::program {

/// A robot arm of seven joints with a hand of two fingers, on a table among shelves and scans: what a planner asks
/// about. Lengths are metres; the arm's base is at the world's origin, z up.
class ArmWorld {
 public:
  static constexpr std::size_t kJoints = 7;
  using Joints = std::array<double, kJoints>;  ///< Radians.
  using Poses = std::vector<Eigen::Isometry3d>;

  struct Thing {
    std::string name;
    std::shared_ptr<const Mesh> mesh;
    Eigen::Isometry3d X_WT = Eigen::Isometry3d::Identity();  ///< World from mesh, of a thing that does not move.
  };

  /// Links of about `triangles_a_link` triangles each; of each scan there are three on the shelves, 0.2 to 0.4 m long.
  ArmWorld(std::size_t triangles_a_link, const std::vector<std::shared_ptr<const Mesh>>& scans, std::uint64_t seed);

  const std::vector<Thing>& links() const { return links_; }
  const std::vector<Thing>& things() const { return things_; }

  /// Links that may touch, as an SRDF lists them: those next to each other, and the parts of the hand.
  bool mayTouch(std::size_t link, std::size_t other) const;

  /// World from each link.
  Poses posesAt(const Joints& q) const;

  static Joints randomJoints(Random& random);

  /// From one state towards another, at most 1 rad in all, in steps of 0.02 rad (Euclidean norm of the joints).
  static std::vector<Joints> edge(const Joints& from, const Joints& to);

 private:
  void addHand(std::size_t triangles);
  void addThings(const std::vector<std::shared_ptr<const Mesh>>& scans, std::uint64_t seed);

  std::vector<Thing> links_, things_;
};

}  // namespace bocst::program
