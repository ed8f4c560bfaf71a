// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "paper/paper_study.h"
#include "paper/plot.h"

namespace bocst::program {

struct PaperStudy {
  std::vector<TreeStudy> trees;  ///< Of the paper's bunny and, with a second mesh, its dragon.
  AnimationStudy animation;
};

/// The report as Markdown and its pictures, which it expects at the names given with them.
struct PaperReport {
  struct Named {
    std::string name;
    std::vector<Plot> plots;
    int height = 0;  ///< Of each plot, in pixels.
  };
  static constexpr int kWidth = 800;

  std::string text;
  std::vector<Named> pictures;
};

/// command: what made it, for the reader. Figures are set beside the paper's; what is said of them follows from them.
PaperReport paperReport(const PaperStudy& study, const std::string& command);

}  // namespace bocst::program
