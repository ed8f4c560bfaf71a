// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "io/polygons.h"

namespace bocst::io {

/// Reads what assimp reads beside the formats that have a reader here (GLB, glTF, 3MF, ...): all meshes of the scene,
/// each where its nodes put it; equal vertices are joined. `content` are the bytes of `file`; beside it only regular
/// files in its folder are opened.
/// @throws std::runtime_error with assimp's reason.
Polygons readScene(const std::string& file, std::string_view content);

/// The endings of files ("glb") that the assimp that is there reads, sorted.
std::vector<std::string> sceneEndings();

}  // namespace bocst::io
