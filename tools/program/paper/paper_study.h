// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/oracle.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "cli/report.h"
#include "mesh/sphere_error.h"
#include "paper/animation.h"
#include "paper/paper_values.h"

namespace bocst::program {

/// A mesh as the study takes it.
struct StudyMesh {
  std::string file;
  std::size_t triangles_of_file = 0;
  std::shared_ptr<const Mesh> mesh;
};

/// Complete trees of one mesh: tables 1 and 2, figures 3 and 4.
struct TreeStudy {
  struct Tree {
    double dimension = 0;              ///< d_t; 0: O-BOCST.
    std::vector<LevelError> levels;    ///< From level 1 on.
    std::vector<std::size_t> sampled;  ///< Nodes by level that the paper's own test finds; empty if not asked.
    const PaperTree* paper = nullptr;  ///< Its row in the table; null where it has none.
  };
  const PaperMesh* paper = nullptr;
  StudyMesh mesh;
  std::vector<Tree> trees;  ///< O first, then B by d_t.

  const Tree& at(double dimension) const;
};

/// `sampled`: also count what OracleKind::kSampled finds.
TreeStudy studyTrees(const PaperMesh& paper, const StudyMesh& mesh, bool sampled);

/// The animation with one oracle: a run beside each column of tables 4 to 6.
struct AnimationStudy {
  struct Column {
    const PaperRun* paper = nullptr;
    Animation::Run run;
    std::size_t missed = 0;  ///< Frames in which surfaces touch and no pair collides.
  };
  struct OfOracle {
    OracleInfo oracle;
    std::vector<Column> columns;  ///< As paperRuns(); empty when the oracle cannot be had.
  };
  StudyMesh object;
  std::vector<StudyMesh> obstacles;
  std::size_t frames = 0;
  std::vector<std::vector<bool>> touching;  ///< Of Animation::kDimensions, by frame.
  std::vector<OfOracle> oracles;

  std::size_t touchingFrames(double dimension) const;
};

/// meshes: the object, then one to three that stand for the obstacles in turn; alone, it moves over itself.
AnimationStudy studyAnimation(const std::vector<StudyMesh>& meshes, const std::vector<OracleInfo>& oracles,
                              std::size_t frames);

Json json(const TreeStudy& study);
Json json(const AnimationStudy& study);

std::string methodName(Subdivision subdivision);  ///< "O" or "B".
std::string methodOf(const TreeStudy::Tree& tree);

}  // namespace bocst::program
