// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <string_view>

#include "polygons.h"
#include "text.h"

namespace bocst::io {

/// Reads an OFF file. Our own reader, since assimp 5.2's rounds coordinates to float, drops polygons of ten and more
/// corners, moves indices that are out of range to the last vertex and takes truncated files for good, all silently.
/// @throws std::runtime_error saying what is wrong in which line.
inline Polygons readOff(std::string_view text) {
  std::size_t line_number = 0;
  const auto fail = [&line_number](const std::string& what) {
    throw std::runtime_error("line " + std::to_string(line_number) + ": " + what);
  };
  // The next line that says something: comments and blank lines do not count.
  const auto next_line = [&text, &line_number](std::string_view& line) {
    while (!text.empty()) {
      line = takeLine(text);
      ++line_number;
      line = line.substr(0, line.find('#'));
      if (line.find_first_not_of(kBlanks) != std::string_view::npos) return true;
    }
    return false;
  };

  std::string_view line;
  if (!next_line(line)) throw std::runtime_error("no OFF file: nothing but blank lines");
  // The keyword is [ST][C][N][4][n]OFF and may be missing.
  std::string_view rest = line;
  const std::string_view keyword = takeWord(rest);
  if (keyword.size() >= 3 && keyword.substr(keyword.size() - 3) == "OFF") {
    if (keyword.find_first_not_of("STCNOF") != std::string_view::npos) fail("only three-dimensional OFF is supported");
    line = rest;
    if (takeWord(rest) == "BINARY") fail("binary OFF is not supported");
    if (line.find_first_not_of(kBlanks) == std::string_view::npos && !next_line(line)) {
      fail("truncated: no numbers of vertices and faces");
    }
  }
  long long vertex_count = 0;
  long long face_count = 0;
  if (!takeNumber(line, vertex_count) || !takeNumber(line, face_count) || vertex_count < 0 || face_count < 0) {
    fail("no OFF file: numbers of vertices and faces expected");
  }

  // Each vertex and each face takes a line: never reserve more than the file can hold.
  const auto bytes = static_cast<long long>(text.size());
  const auto truncated = [](long long found, long long promised, const char* what) {
    throw std::runtime_error("truncated: " + std::to_string(found) + " of " + std::to_string(promised) + " " + what);
  };
  Polygons polygons;
  polygons.vertices.reserve(static_cast<std::size_t>(std::min(vertex_count, bytes)));
  for (long long v = 0; v < vertex_count; ++v) {
    if (!next_line(line)) truncated(v, vertex_count, "vertices");
    Eigen::Vector3d p;
    for (int i = 0; i < 3; ++i) {
      if (!takeNumber(line, p[i])) fail("vertex " + std::to_string(v) + ": three numbers expected");
    }
    polygons.vertices.push_back(p);
  }
  polygons.ends.reserve(static_cast<std::size_t>(std::min(face_count, bytes)));
  for (long long f = 0; f < face_count; ++f) {
    if (!next_line(line)) truncated(f, face_count, "faces");
    const std::string face = "face " + std::to_string(f) + ": ";
    long long n = 0;
    if (!takeNumber(line, n) || n < 0) fail(face + "number of corners expected");
    for (long long i = 0; i < n; ++i) {
      long long index = 0;
      if (!takeNumber(line, index)) fail(face + std::to_string(n) + " vertex indices expected");
      if (index < 0 || index >= vertex_count) {
        fail(face + "vertex index " + std::to_string(index) + " out of range, there are " +
             std::to_string(vertex_count) + " vertices");
      }
      polygons.corners.push_back(static_cast<std::uint32_t>(index));
    }
    polygons.ends.push_back(polygons.corners.size());
  }
  return polygons;
}

}  // namespace bocst::io
