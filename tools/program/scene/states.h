// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "scene/json_element.h"

namespace bocst::program {

/// Where all that moves is.
struct State {
  std::string place;                       ///< In its file: "line 3".
  std::vector<double> joints;              ///< Values of the robot's free joints.
  std::vector<Eigen::Isometry3d> objects;  ///< X_WO of each moving object.
};

/// What the numbers of a state are called.
struct StateNames {
  std::vector<std::string> joints;            ///< Of the free joints.
  std::map<std::string, std::string> others;  ///< Joints that are not given, and why: "is fixed".
  std::vector<std::string> objects;           ///< That move.
  /// Where objects are whose poses are not given.
  std::vector<std::optional<Eigen::Isometry3d>> X_WO;
};

/// Joints at 0, objects where the file of the scene says. @throws std::runtime_error for an object without a pose.
State startState(const StateNames& names);

/// A table: a line with the names of columns, then one a state. Columns are separated by commas, semicolons or tabs, or
/// by blanks if the first line has none of these: the free joints, and of moving objects object.x, .y, .z with .qw,
/// .qx, .qy, .qz or .roll, .pitch, .yaw. Cells may be in quotes, as in CSV. What follows # and empty lines are skipped.
/// @param file for messages. @param warnings of quaternions. @throws std::runtime_error that names the line and the
/// column.
std::vector<State> statesOfTable(const std::string& text, const StateNames& names, const std::string& file,
                                 std::vector<std::string>& warnings);

/// {"joint": value, "object": pose, ...}. @throws std::runtime_error as JsonElement.
State stateOfJson(const JsonElement& element, const StateNames& names);

}  // namespace bocst::program
