// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "read_mesh.h"
#include "text.h"

namespace bocst::io {
namespace {

bool isBlank(std::string_view text) { return text.find_first_not_of(kBlanks) == std::string_view::npos; }

/// What may follow the numbers of a vertex or a face: a normal, a colour, texture coordinates.
void checkExtras(std::string_view file, std::string_view line, int most) {
  for (double ignored = 0; !isBlank(line); --most) {
    std::string_view rest = line;
    if (most == 0 || !takeNumber(line, ignored)) failAt(file, rest.data(), inQuotes(takeWord(rest)) + " not expected");
  }
}

}  // namespace

Polygons readOff(std::string_view bytes) {
  std::string_view text = bytes;
  std::string_view line;
  // The next line that says something: comments and blank lines do not count.
  const auto next_line = [&text, &line] {
    while (!text.empty()) {
      line = takeLine(text);
      line = line.substr(0, line.find('#'));
      if (!isBlank(line)) return true;
    }
    return false;
  };
  const auto fail = [&](const std::string& what) { failAt(bytes, line.data(), what); };

  if (!next_line()) throw std::runtime_error("no OFF file: nothing but blank lines");
  // The keyword is [ST][C][N][4][n]OFF and may be missing.
  std::string_view rest = line;
  const std::string_view keyword = takeWord(rest);
  if (keyword.size() >= 3 && keyword.substr(keyword.size() - 3) == "OFF") {
    if (keyword.find_first_not_of("STCNOF") != std::string_view::npos) fail("only three-dimensional OFF is supported");
    line = rest;
    if (takeWord(rest) == "BINARY") fail("binary OFF is not supported");
    if (isBlank(line) && !next_line()) fail("truncated: no numbers of vertices and faces");
  }
  long long vertex_count = 0;
  long long face_count = 0;
  long long edge_count = 0;  // not used, often 0
  if (!takeNumber(line, vertex_count) || !takeNumber(line, face_count) || vertex_count < 0 || face_count < 0) {
    fail("no OFF file: numbers of vertices and faces expected");
  }
  if (!isBlank(line) && (!takeNumber(line, edge_count) || !isBlank(line))) {
    fail("numbers of vertices, faces and edges expected, and nothing else");
  }

  // Each vertex and each face takes a line: never reserve more than the file can hold.
  const auto bytes_left = static_cast<long long>(text.size());
  const auto truncated = [](long long found, long long promised, const char* what) {
    throw std::runtime_error("truncated: " + std::to_string(found) + " of " + std::to_string(promised) + " " + what);
  };
  Polygons polygons;
  polygons.vertices.reserve(static_cast<std::size_t>(std::min(vertex_count, bytes_left)));
  for (long long v = 0; v < vertex_count; ++v) {
    if (!next_line()) truncated(v, vertex_count, "vertices");
    Eigen::Vector3d p;
    for (int i = 0; i < 3; ++i) {
      p[i] = takeCoordinate(bytes, line, "vertex " + std::to_string(v));
    }
    checkExtras(bytes, line, 9);
    polygons.vertices.push_back(p);
  }
  polygons.ends.reserve(static_cast<std::size_t>(std::min(face_count, bytes_left)));
  for (long long f = 0; f < face_count; ++f) {
    if (!next_line()) truncated(f, face_count, "faces");
    const auto face = [f] { return "face " + std::to_string(f) + ": "; };
    long long n = 0;
    if (!takeNumber(line, n) || n < 0) fail(face() + "number of corners expected");
    for (long long i = 0; i < n; ++i) {
      long long index = 0;
      if (!takeNumber(line, index)) fail(face() + std::to_string(n) + " vertex indices expected");
      if (index < 0 || index >= vertex_count) {
        fail(face() + "vertex index " + std::to_string(index) + " out of range, there are " +
             std::to_string(vertex_count) + " vertices");
      }
      polygons.corners.push_back(static_cast<std::uint32_t>(index));
    }
    checkExtras(bytes, line, 4);
    polygons.ends.push_back(polygons.corners.size());
  }
  if (next_line()) fail("there is more after the last face");
  return polygons;
}

}  // namespace bocst::io
