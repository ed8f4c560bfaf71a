// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "scene/scene_setup.h"

namespace bocst::program {

/// What the command line says of a scene.
struct SceneArguments {
  enum class Adjacent { kAsSrdf, kIgnore, kCheck };

  std::string file;                   ///< A scene file or a URDF.
  std::string states;                 ///< A table; empty: those of the scene file.
  std::string srdf;                   ///< Empty: that of the scene file.
  std::vector<std::string> packages;  ///< name=folder.
  /// Links that a joint joins: with kAsSrdf they are checked where an SRDF does not disable it, and ignored without
  /// one.
  Adjacent adjacent = Adjacent::kAsSrdf;
};

/// Reads all that the arguments name; share/doc/scene-program.md describes the scene file.
/// @throws std::runtime_error that names the file and the line or the element.
SceneSetup readScene(const SceneArguments& arguments);

}  // namespace bocst::program
