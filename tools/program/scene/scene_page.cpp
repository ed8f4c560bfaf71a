// SPDX-License-Identifier: BSD-3-Clause
#include "scene/scene_page.h"

#include <algorithm>
#include <filesystem>

#include "scene/shape_mesh.h"

namespace bocst::program {

Page scenePage(const std::string& file, const SceneSetup& setup, const Bodies& bodies, const SceneAnswers& answers) {
  Page page(std::filesystem::path(file).filename().string());
  if (setup.robot) page.fact("robot", setup.robot->name());
  page.fact("states", std::to_string(answers.hit.size()));
  page.fact("collisions", std::to_string(std::count(answers.hit.begin(), answers.hit.end(), 1)));
  for (const std::string& note : setup.notes) page.fact("note", note);

  // Parts without shapes are not shown.
  std::vector<std::size_t> object_of(setup.partCount());
  std::vector<std::size_t> shown;
  const std::vector<Eigen::Isometry3d> start = setup.partPoses(setup.states.front());
  for (std::size_t i = 0; i < setup.partCount(); ++i) {
    if (setup.part(i).shapes.empty()) continue;
    object_of[i] = shown.size();
    shown.push_back(i);
    page.object(setup.part(i).name, *meshOf(setup.part(i)), start[i]);
  }
  std::vector<std::size_t> moving;
  for (std::size_t o = 0; o < shown.size(); ++o) {
    if (setup.moves(shown[o])) moving.push_back(o);
  }
  page.moving(moving, answers.hit.size());
  for (std::size_t k = 0; k < std::min(answers.hit.size(), Page::kMaxStates); ++k) {
    const std::vector<Eigen::Isometry3d> X_WP = setup.partPoses(setup.states[k]);
    PageState state;
    state.name = setup.states[k].place;
    for (const std::size_t o : moving) state.poses.push_back(X_WP[shown[o]]);
    for (const auto& [a, b] : answers.pairs[k]) {
      state.contacts.emplace_back(object_of[bodies.bodies[a].part], object_of[bodies.bodies[b].part]);
    }
    std::sort(state.contacts.begin(), state.contacts.end());
    state.contacts.erase(std::unique(state.contacts.begin(), state.contacts.end()), state.contacts.end());
    if (!answers.clearance.empty() && answers.clearance[k].nearest) state.clearance = answers.clearance[k].distance;
    page.state(state);
  }
  return page;
}

}  // namespace bocst::program
