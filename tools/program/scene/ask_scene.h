// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/options.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "scene/scene_side.h"

namespace bocst::program {

/// Microseconds.
struct SceneTimes {
  double set_up = 0;  ///< Geometries and scene, from the arrays.
  double first = 0;   ///< All states, asked for the first time.
  double again = 0;   ///< The same once more.
};

/// A pair of bodies of which bocst and FCL say different things.
struct SceneDifference {
  std::size_t state;
  BodyPair pair;
  bool bocst;  ///< bocst's verdict; FCL's is the other.
  bool fault;  ///< Else it is explained: by the answer, or by FCL's solver for a shape.
};

/// True if it is bocst's fault that only one of the two finds a pair. `meshes`: of two meshes; `bocst`: bocst finds it;
/// `equal`: verdicts must be FCL's, otherwise bocst may find more.
inline bool isFault(bool meshes, bool bocst, bool equal) { return meshes && (equal || !bocst); }

struct SceneAnswers {
  std::vector<std::uint8_t> hit;             ///< Of each state.
  std::vector<std::vector<BodyPair>> pairs;  ///< All that collide, of each state.
  std::vector<Clearance> clearance;          ///< Of each state, if it was asked for.
  std::string oracle;
  SceneTimes bocst;
  std::optional<SceneTimes> built;  ///< The same with all trees built in the set-up; of exact answers.
  std::size_t bytes = 0;
  std::optional<SceneTimes> fcl;  ///< If FCL was asked.
  std::size_t fcl_bytes = 0;
  std::vector<SceneDifference> differences;
};

/// What is asked besides the verdicts.
struct SceneQuestions {
  Scalar scalar = Scalar::kDouble;
  Options options;
  bool clearance = false;
  bool fcl = true;
};

/// Asks bocst::Scene, and beside it FCL's managers.
///
/// Pairs of meshes must be those of FCL with exact answers, doubles and no margin; otherwise bocst may find more. With
/// shapes, FCL's solvers are iterative, so that bocst may differ from them where surfaces all but touch.
/// @throws std::runtime_error when Scene and the pairs' own answers differ.
SceneAnswers askScene(const SceneSetup& setup, const Bodies& bodies, const SceneQuestions& questions);

}  // namespace bocst::program
