// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "robot/parts.h"
#include "robot/robot.h"
#include "scene/states.h"

namespace bocst::program {

/// What is no robot.
struct SceneObject {
  Part part;
  bool moving = false;              ///< States say where it is.
  std::optional<std::size_t> link;  ///< That it is attached to.
  std::optional<Eigen::Isometry3d>
      X_WO;  ///< Moving: where it is if a state does not say. Attached: in the link's frame.
};

/// A joint's value outside of its limits.
struct OutsideLimits {
  std::size_t joint;
  double value;
};

/// A robot, objects, and where they are asked about. Parts are the robot's links, then the objects; a pair of parts is
/// asked about unless both are fixed objects or it is allowed. All links count as moving.
struct SceneSetup {
  std::string file;  ///< The scene file or URDF.
  std::optional<Robot> robot;
  Eigen::Isometry3d X_WR = Eigen::Isometry3d::Identity();  ///< Of the robot's root.
  std::vector<SceneObject> objects;
  std::set<std::pair<std::size_t, std::size_t>> allowed;  ///< Pairs of parts that may touch, the smaller index first.
  std::vector<State> states;
  std::string states_file;            ///< That names the places of states.
  std::string states_from;            ///< In words: a file, or what stands for it.
  std::vector<std::string> notes;     ///< What was decided for the user.
  std::vector<std::string> warnings;  ///< What is probably a mistake.

  std::size_t linkCount() const { return robot ? robot->links().size() : 0; }
  std::size_t partCount() const { return linkCount() + objects.size(); }
  const Part& part(std::size_t i) const { return i < linkCount() ? robot->links()[i] : objects[i - linkCount()].part; }
  bool moves(std::size_t part) const {
    return part < linkCount() || objects[part - linkCount()].moving || objects[part - linkCount()].link;
  }

  StateNames names() const;
  std::vector<Eigen::Isometry3d> partPoses(const State& state) const;  ///< X_WP.
  std::vector<OutsideLimits> outsideLimits(const State& state) const;
};

}  // namespace bocst::program
