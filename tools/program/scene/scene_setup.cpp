// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_setup.h"

namespace bocst::program {

StateNames SceneSetup::names() const {
  StateNames names;
  if (robot) {
    for (const std::size_t i : robot->freeJoints()) names.joints.push_back(robot->joints()[i].name);
    for (const Joint& joint : robot->joints()) {
      if (joint.kind == Joint::Kind::kFixed) {
        names.others[joint.name] = "is fixed";
      } else if (joint.mimic) {
        names.others[joint.name] = "mimics " + joint.mimic->joint;
      }
    }
  }
  for (const SceneObject& object : objects) {
    if (!object.moving) continue;
    names.objects.push_back(object.part.name);
    names.X_WO.push_back(object.X_WO);
  }
  return names;
}

std::vector<Eigen::Isometry3d> SceneSetup::partPoses(const State& state) const {
  std::vector<Eigen::Isometry3d> X_WP;
  X_WP.reserve(partCount());
  if (robot) {
    for (const Eigen::Isometry3d& X_RL : robot->linkPoses(state.joints)) X_WP.push_back(X_WR * X_RL);
  }
  std::size_t moving = 0;
  for (const SceneObject& object : objects) {
    X_WP.push_back(object.moving ? state.objects[moving++]
                   : object.link ? X_WP[*object.link] * *object.X_WO
                                 : *object.X_WO);
  }
  return X_WP;
}

std::vector<OutsideLimits> SceneSetup::outsideLimits(const State& state) const {
  std::vector<OutsideLimits> outside;
  if (!robot) return outside;
  const std::vector<double> values = robot->jointValues(state.joints);
  for (std::size_t i = 0; i < values.size(); ++i) {
    const std::optional<Joint::Limits>& limits = robot->joints()[i].limits;
    if (limits && !(values[i] >= limits->lower && values[i] <= limits->upper)) outside.push_back({i, values[i]});
  }
  return outside;
}

}  // namespace bocst::program
