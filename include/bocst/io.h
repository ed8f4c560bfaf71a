// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/mesh.h>

#include <memory>
#include <string>

namespace bocst {

/// Reads a triangle mesh: OBJ, PLY, STL, OFF, DAE. Faces with more corners are triangulated; all meshes of the file
/// become one, transforms of its nodes applied; equal vertices of STL are joined. In target bocst::io.
/// @throws std::runtime_error naming the file and what is wrong: not there, empty, truncated, no mesh, bad numbers.
BOCST_EXPORT std::shared_ptr<const Mesh> loadMesh(const std::string& file);

}  // namespace bocst
