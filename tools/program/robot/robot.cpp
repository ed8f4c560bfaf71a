// SPDX-License-Identifier: BSD-3-Clause
#include "robot/robot.h"

#include <algorithm>
#include <map>
#include <stdexcept>

namespace bocst::program {

Robot::Robot(std::string name, std::vector<Part> links, std::vector<Joint> joints)
    : name_(std::move(name)), links_(std::move(links)), joints_(std::move(joints)), sources_(joints_.size()) {
  std::map<std::string, std::size_t> index;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    index[joints_[i].name] = i;
    if (joints_[i].kind == Joint::Kind::kFixed || joints_[i].mimic) continue;
    sources_[i] = Source{free_.size(), 1, 0};
    free_.push_back(i);
  }
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    if (sources_[i] || joints_[i].kind == Joint::Kind::kFixed) continue;
    Source source{0, 1, 0};
    std::size_t leader = i;
    for (std::size_t steps = 0; joints_[leader].mimic; ++steps) {
      const Joint::Mimic& mimic = *joints_[leader].mimic;
      const auto found = index.find(mimic.joint);
      if (found == index.end()) {
        throw JointError(joints_[leader].name, "mimics " + mimic.joint + ", which is no joint");
      }
      source.offset += source.multiplier * mimic.offset;
      source.multiplier *= mimic.multiplier;
      leader = found->second;
      if (steps > joints_.size()) throw JointError(joints_[i].name, "mimics itself");
      if (joints_[leader].kind == Joint::Kind::kFixed) {
        throw JointError(joints_[i].name, "mimics " + mimic.joint + ", which is fixed");
      }
    }
    source.column = sources_[leader]->column;
    sources_[i] = source;
  }
  findFrames();
}

std::vector<double> Robot::jointValues(const std::vector<double>& state) const {
  std::vector<double> values(joints_.size(), 0.0);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (sources_[i]) values[i] = sources_[i]->multiplier * state[sources_[i]->column] + sources_[i]->offset;
  }
  return values;
}

std::vector<Eigen::Isometry3d> Robot::linkPoses(const std::vector<double>& state) const {
  const std::vector<double> values = jointValues(state);
  std::vector<Eigen::Isometry3d> X_RL(links_.size(), Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Joint& joint = joints_[i];
    Eigen::Isometry3d& X = X_RL[i + 1];
    X = X_RL[joint.parent] * joint.X_PJ;
    if (joint.kind == Joint::Kind::kPrismatic) {
      X.translate(values[i] * joint.axis);
    } else if (joint.kind != Joint::Kind::kFixed) {
      X.rotate(Eigen::AngleAxisd(values[i], joint.axis));
    }
  }
  return X_RL;
}

void Robot::findFrames() {
  frame_.resize(links_.size());
  around_.resize(links_.size());
  for (std::size_t i = 0; i < links_.size(); ++i) {
    frame_[i] = i;
    if (i == 0) continue;
    const std::size_t parent = joints_[i - 1].parent;
    const bool has_shapes = !links_[i].shapes.empty();
    if (has_shapes == links_[parent].shapes.empty()) {
      around_[has_shapes ? frame_[parent] : i].push_back(has_shapes ? i : parent);
    } else if (!has_shapes) {
      frame_[i] = frame_[parent];
    }
  }
}

std::vector<std::pair<std::size_t, std::size_t>> Robot::adjacentLinks() const {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;  // each once, because links are a tree
  for (std::size_t i = 1; i < links_.size(); ++i) {
    const std::size_t parent = joints_[i - 1].parent;
    if (!links_[i].shapes.empty() && !links_[parent].shapes.empty()) pairs.emplace_back(parent, i);
  }
  for (const std::vector<std::size_t>& links : around_) {
    for (auto a = links.begin(); a != links.end(); ++a) {
      for (auto b = a + 1; b != links.end(); ++b) pairs.emplace_back(*a, *b);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

}  // namespace bocst::program
