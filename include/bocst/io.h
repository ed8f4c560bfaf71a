// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/mesh.h>

#include <memory>
#include <string>
#include <vector>

namespace bocst {

/// Reads a triangle mesh from a file. The file extension selects the format. Needs the CMake target bocst::io.
///
/// OBJ, PLY, STL, OFF and DAE are read by bocst's own readers: for any content the result is a mesh or an exception.
/// They open no other file and skip materials, normals, colours and texture coordinates. Coordinates are read as
/// doubles, in any locale. Other formats (GLB, glTF, 3MF, ...) are read by assimp in this process, with its limits:
/// float coordinates, and no guarantee for malformed files. It may open regular files in the folder of the file. Valid
/// files that assimp would misread are refused: glTF with extensions about geometry (quantization, instances) or
/// unknown ones (Draco may be used, except with indices of 32 bits), glTF with a skin without inverseBindMatrices, and
/// AMF with a `<constellation>`.
///
/// Coordinates and axes are those of the file. The coordinates of DAE are converted to metres (`<unit meter="...">`);
/// the length units that 3MF, AMF and FBX state are not applied: a 3MF in inches gives inches. The axes of DAE stay as
/// they are, also if up_axis is not z. Transforms of nodes are applied, and all meshes of the file become one. For a
/// `<controller>` of DAE and a skin of glTF, the undeformed shape is read.
///
/// Faces with more than three corners are divided into triangles; points and lines are skipped. Vertices and their
/// order are those of the file, but equal vertices of STL and of assimp's formats are merged. In triangle strips of PLY
/// and DAE, triangles with a repeated corner are removed.
///
/// @throws std::runtime_error if the file cannot be read as a mesh. The message names the file, the fault and, where it
/// has one place, the line (the byte in binary data). Faults are: not a regular file (it never waits for a FIFO or a
/// device), empty, a Git LFS pointer, truncated, no triangles, invalid or non-finite numbers, indices that are
/// fractional or out of range, data after the end. Binary OFF, polygons with holes (`<ph>`) and free-form surfaces are
/// not supported.
BOCST_EXPORT std::shared_ptr<const Mesh> loadMesh(const std::string& file);

/// A format that loadMesh() reads.
struct MeshFormat {
  std::string ending;  ///< File extension in lower case, without the dot: "obj".
  bool by_assimp;      ///< True: read by assimp; false: by bocst's own reader.
};

/// All formats: first those of bocst's own readers, then those of the assimp library in use.
BOCST_EXPORT std::vector<MeshFormat> meshFormats();

}  // namespace bocst
