// SPDX-License-Identifier: BSD-3-Clause
#include "scene/ask_scene.h"

#include <algorithm>
#include <iterator>
#include <stdexcept>

#include "cli/report.h"

namespace bocst::program {
namespace {

/// Makes a side and asks it twice.
template <typename Make>
auto measured(const Make& make, std::vector<std::uint8_t>& hit, SceneTimes& times) {
  const Stopwatch set_up;
  auto side = make();
  times.set_up = set_up.microseconds();
  const Stopwatch first;
  hit = side->collisions();
  times.first = first.microseconds();
  const Stopwatch again;
  side->collisions();
  times.again = again.microseconds();
  return side;
}

bool contains(const std::vector<BodyPair>& sorted, const BodyPair& pair) {
  return std::binary_search(sorted.begin(), sorted.end(), pair);
}

}  // namespace

SceneAnswers askScene(const SceneSetup& setup, const Bodies& bodies, const SceneQuestions& questions) {
  const std::vector<Eigen::Isometry3d> poses = posesOf(setup, bodies);
  SceneAnswers answers;
  const auto make = [&] { return makeBocstSide(questions.scalar, bodies, poses, questions.options); };
  const std::unique_ptr<BocstSide> ours = measured(make, answers.hit, answers.bocst);
  answers.oracle = ours->oracleName();
  answers.bytes = ours->bytes();
  if (questions.options.answer == Answer::kExact) {
    std::vector<std::uint8_t> hit;
    const auto makeBuilt = [&] {
      auto side = make();
      side->buildTrees();
      return side;
    };
    measured(makeBuilt, hit, answers.built.emplace());
    if (hit != answers.hit)
      throw std::runtime_error("trees that are built first give other verdicts; please report it");
  }

  std::unique_ptr<SceneSide> theirs;
  std::vector<std::uint8_t> fcl_hit(answers.hit.size(), 0);
  if (questions.fcl) {
    theirs = measured([&] { return makeFclSide(questions.scalar, bodies, poses); }, fcl_hit, answers.fcl.emplace());
    answers.fcl_bytes = theirs->bytes();
  }
  const bool equal = questions.options.answer == Answer::kExact && questions.scalar == Scalar::kDouble &&
                     questions.options.margin == 0;
  Progress progress("state", answers.hit.size());
  for (std::size_t k = 0; k < answers.hit.size(); ++k) {
    std::vector<BodyPair> pairs, fcl_pairs;
    if (answers.hit[k] != 0 || fcl_hit[k] != 0) pairs = ours->pairs(k);
    if (pairs.empty() != (answers.hit[k] == 0)) {
      throw std::runtime_error(setup.states[k].place + ": bocst::Scene reports " +
                               (answers.hit[k] != 0 ? "collision" : "free") +
                               ", but its pairs do not; please report the scene");
    }
    if (theirs != nullptr && (answers.hit[k] != 0 || fcl_hit[k] != 0)) fcl_pairs = theirs->pairs(k);
    std::vector<BodyPair> different;
    if (theirs != nullptr) {
      std::set_symmetric_difference(pairs.begin(), pairs.end(), fcl_pairs.begin(), fcl_pairs.end(),
                                    std::back_inserter(different));
    }
    for (const BodyPair& pair : different) {
      const bool found = contains(pairs, pair);
      answers.differences.push_back({k, pair, found, isFault(bodies.meshes(pair.first, pair.second), found, equal)});
    }
    answers.pairs.push_back(std::move(pairs));
    if (questions.clearance) answers.clearance.push_back(ours->clearance(k));
    progress.step();
  }
  return answers;
}

}  // namespace bocst::program
