// SPDX-License-Identifier: BSD-3-Clause
// A unit square of two triangles as a file of each format.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

namespace bocst::test {

template <typename T>
void append(std::string& bytes, T value, bool big_endian = false) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  if (big_endian) std::reverse(raw, raw + sizeof(T));
  bytes.append(raw, sizeof(T));
}

inline std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  if (at == std::string::npos) throw std::logic_error("no such text: " + what);
  return text.replace(at, what.size(), by);
}

const std::string kOff = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
const std::string kPlyHead =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
const std::string kPly = "ply\nformat ascii 1.0\n" + kPlyHead + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n";
const std::string kStl =
    "solid s\n"
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nendloop\nendfacet\n"
    "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 1 0\nvertex 0 1 0\nendloop\nendfacet\n"
    "endsolid s\n";

inline std::string binaryPly(bool big_endian = false) {
  std::string ply = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") + "_endian 1.0\n" + kPlyHead;
  for (const float x : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) append(ply, x, big_endian);
  for (const auto& t : {std::array<int, 3>{0, 1, 2}, std::array<int, 3>{0, 2, 3}}) {
    append(ply, std::uint8_t{3});
    for (const std::int32_t i : t) append(ply, i, big_endian);
  }
  return ply;
}

}  // namespace bocst::test
