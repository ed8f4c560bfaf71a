// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "robot/parts.h"

namespace bocst::program {

/// Moves a link with respect to its parent.
struct Joint {
  enum class Kind { kFixed, kRevolute, kContinuous, kPrismatic };
  struct Limits {
    double lower, upper;
  };
  /// Its value is multiplier * (value of another joint) + offset.
  struct Mimic {
    std::string joint;
    double multiplier, offset;
  };

  std::string name;
  Kind kind = Kind::kFixed;
  std::size_t parent = 0;  ///< The link that it is on.
  Eigen::Isometry3d X_PJ =
      Eigen::Isometry3d::Identity();                ///< Of the link that it moves, at the value 0, in the parent.
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< A unit vector in the frame X_PJ.
  std::optional<Limits> limits;
  std::optional<Mimic> mimic;
};

/// A fault of a joint. what() names the joint, too.
struct JointError : std::runtime_error {
  JointError(const std::string& joint_, const std::string& fault)
      : std::runtime_error("joint " + joint_ + " " + fault), joint(joint_) {}
  std::string joint;
};

/// A tree of links.
class Robot {
 public:
  /// @param links the root first; joint i moves link i + 1, and its parent is one of the links 0 to i.
  /// @throws JointError for a joint that mimics no joint, a fixed one or, by way of others, itself.
  Robot(std::string name, std::vector<Part> links, std::vector<Joint> joints);

  const std::string& name() const { return name_; }
  const std::vector<Part>& links() const { return links_; }
  const std::vector<Joint>& joints() const { return joints_; }

  /// The joints whose values are a state, in the order of joints(): those that move and mimic no other.
  const std::vector<std::size_t>& freeJoints() const { return free_; }

  /// The value of each joint, of fixed ones 0. @param state of each free joint.
  std::vector<double> jointValues(const std::vector<double>& state) const;

  /// The pose of each link in the root's frame.
  std::vector<Eigen::Isometry3d> linkPoses(const std::vector<double>& state) const;

  /// Pairs of links with shapes that joints join, directly or by way of links without shapes. Smaller index first.
  std::vector<std::pair<std::size_t, std::size_t>> adjacentLinks() const;

  /// The links with shapes that joints join to a link without shapes, directly or by way of others without; none for a
  /// link with shapes.
  const std::vector<std::size_t>& linksAround(std::size_t link) const { return around_[frame_[link]]; }

 private:
  /// The value of a joint as multiplier * state[column] + offset.
  struct Source {
    std::size_t column;
    double multiplier, offset;
  };

  void findFrames();

  std::string name_;
  std::vector<Part> links_;
  std::vector<Joint> joints_;
  std::vector<std::size_t> free_;
  std::vector<std::optional<Source>> sources_;  ///< None of fixed joints.
  std::vector<std::size_t> frame_;  ///< Of each link: the uppermost that it reaches across links without shapes.
  std::vector<std::vector<std::size_t>> around_;  ///< Of each such frame: links with shapes next to it, in order.
};

}  // namespace bocst::program
