// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "robot/robot.h"

namespace bocst::program {

/// What an SRDF says about pairs of links.
struct Srdf {
  std::set<std::pair<std::size_t, std::size_t>> disabled;  ///< Links of the robot, the smaller index first.
  std::vector<std::size_t> unchecked;                      ///< Links that are not checked with what is no link either.
  std::vector<std::string> warnings;  ///< Of another robot's name, and links that it does not have.
};

/// Reads <disable_collisions>, <disable_default_collisions> and <enable_collisions>; all else is skipped.
/// @throws std::runtime_error that names the line; for a URDF, for what xacro has not expanded, and for names that are
/// nearly those of these elements, too.
Srdf readSrdf(const std::string& file, const Robot& robot);

}  // namespace bocst::program
