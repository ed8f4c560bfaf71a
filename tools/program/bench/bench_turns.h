// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "cli/report.h"

namespace bocst::program {

/// One side of a comparison: what it answers to a list of poses, and how long that takes.
template <typename Answer>
class Side {
 public:
  using Ask = std::function<Answer(const Eigen::Isometry3d&)>;

  /// Asks once, so that what is grown on demand is there.
  Side(const std::vector<Eigen::Isometry3d>& X_ABs, Ask ask)
      : X_ABs_(X_ABs), ask_(std::move(ask)), times_(X_ABs.size()) {
    for (const Eigen::Isometry3d& X_AB : X_ABs_) answers_.push_back(ask_(X_AB));
  }

  /// Once without a watch, so that the other side's turn does not count, then once with it.
  void takeTurn() {
    for (const Eigen::Isometry3d& X_AB : X_ABs_) ask_(X_AB);
    for (std::size_t i = 0; i < X_ABs_.size(); ++i) {
      const Stopwatch watch;
      const Answer answer = ask_(X_ABs_[i]);
      times_[i].push_back(watch.microseconds());
      if (answer != answers_[i]) throw std::runtime_error("the same query had a different answer later");
    }
  }

  const std::vector<Answer>& answers() const { return answers_; }

  /// Of the turns, by pose.
  std::vector<double> medians() const {
    std::vector<double> result;
    for (const std::vector<double>& times : times_) result.push_back(quantile(times, 0.5));
    return result;
  }

 private:
  std::vector<Eigen::Isometry3d> X_ABs_;
  Ask ask_;
  std::vector<Answer> answers_;
  std::vector<std::vector<double>> times_;
};

/// So that a slow moment of the machine meets both.
template <typename Answer>
void takeTurns(Side<Answer>& bocst, Side<Answer>& fcl, std::size_t rounds, const std::string& scenario) {
  Progress progress(scenario + ": round", rounds);
  for (std::size_t round = 0; round < rounds; ++round) {
    if (round % 2 == 0) fcl.takeTurn();
    bocst.takeTurn();
    if (round % 2 == 1) fcl.takeTurn();
    progress.step();
  }
}

}  // namespace bocst::program
