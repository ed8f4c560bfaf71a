// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/mesh.h>

#include <memory>
#include <string>
#include <vector>

namespace bocst {

/// Reads a triangle mesh from a file, whose extension tells the format. In target bocst::io.
///
/// OBJ, PLY, STL, OFF and DAE have readers of their own here: whatever their bytes are, the result is a mesh or an
/// exception. They open no other file; materials, normals, colours and texture coordinates are skipped. Coordinates
/// are read as doubles, whatever the locale. Other formats (GLB, glTF, 3MF, ...) are read by assimp in this process,
/// with its limits: floats, and no promise for malformed files. It may open regular files in the folder of the file.
///
/// Coordinates and axes are those of the file. Only DAE says what its unit is: its coordinates become metres
/// (`<unit meter="...">`); its axes stay, too, whatever its up_axis says. Transforms of nodes are applied, and all
/// meshes of the file become one. Of a DAE's `<controller>` the shape that it deforms is taken, undeformed.
///
/// Faces of more than three corners are cut into triangles; points and lines are skipped. Vertices and their order are
/// those of the file, but equal vertices of STL and of assimp's formats are joined. Triangle strips of PLY and DAE
/// lose the triangles with a repeated corner.
///
/// @throws std::runtime_error naming the file and what is wrong, with the line, or with the byte in binary data: no
/// regular file (it never waits for a FIFO or a device), empty, truncated, no triangles, numbers that are none or not
/// finite, indices that are fractional or out of range, anything after the end; binary OFF, polygons with holes
/// (`<ph>`) and free-form surfaces are not supported.
BOCST_EXPORT std::shared_ptr<const Mesh> loadMesh(const std::string& file);

/// A format that loadMesh() reads.
struct MeshFormat {
  std::string ending;  ///< Of files, in small letters, without the dot: "obj".
  bool by_assimp;      ///< Otherwise by a reader of bocst's own.
};

/// All formats: those with readers of their own, then those of the assimp that is there.
BOCST_EXPORT std::vector<MeshFormat> meshFormats();

}  // namespace bocst
