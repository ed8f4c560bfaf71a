// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

#include "io/binary.h"
#include "io/read_mesh.h"
#include "io/text.h"
#include "io/vertex_pool.h"

namespace bocst::io {
namespace {

constexpr std::size_t kHead = 84;   // a comment of 80 bytes and the number of triangles
constexpr std::size_t kFacet = 50;  // a normal, three corners and a number of 16 bits

Polygons readBinary(std::string_view bytes, std::size_t count) {
  Polygons polygons;
  VertexPool pool(polygons.vertices);
  polygons.corners.reserve(3 * count);
  polygons.ends.reserve(count);
  for (std::size_t t = 0; t < count; ++t) {
    std::array<std::uint32_t, 3> corner;
    for (std::size_t k = 0; k < 3; ++k) {
      Eigen::Vector3d p;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t at = kHead + kFacet * t + 12 * (k + 1) + 4 * i;
        p[static_cast<Eigen::Index>(i)] = number<float>(bytes.substr(at), false);
        if (std::isfinite(p[static_cast<Eigen::Index>(i)])) continue;
        throw std::runtime_error("byte " + std::to_string(at) + ": vertex " + std::to_string(k) + " of triangle " +
                                 std::to_string(t) + " is not finite");
      }
      corner[k] = pool.indexOf(p);
    }
    polygons.addTriangle(corner[0], corner[1], corner[2]);
  }
  return polygons;
}

bool equal(std::string_view word, std::string_view lower_case) {
  return std::equal(word.begin(), word.end(), lower_case.begin(), lower_case.end(),
                    [](char a, char b) { return (a >= 'A' && a <= 'Z' ? static_cast<char>(a - 'A' + 'a') : a) == b; });
}

/// Any number of solids, each `solid` and a name, facets, `endsolid` and perhaps the name again.
Polygons readText(std::string_view bytes) {
  Polygons polygons;
  VertexPool pool(polygons.vertices);
  std::size_t vertices = 0;
  std::string_view rest = bytes;
  const char end = lineEnd(bytes);
  const auto expect = [&](std::string_view word, std::initializer_list<std::string_view> keywords) {
    for (const std::string_view keyword : keywords) {
      if (!equal(word, keyword)) {
        if (word.empty()) failAt(bytes, word.data(), "truncated: '" + std::string(keyword) + "' expected");
        failAt(bytes, word.data(), "'" + std::string(keyword) + "' expected, not " + inQuotes(word));
      }
      if (keyword != *(keywords.end() - 1)) word = takeWord(rest);
    }
  };
  for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest)) {
    expect(word, {"solid"});
    takeLine(rest, end);
    for (word = takeWord(rest); !equal(word, "endsolid"); word = takeWord(rest)) {
      if (word.empty()) failAt(bytes, word.data(), "truncated: no 'endsolid' at the end");
      expect(word, {"facet", "normal"});
      for (int i = 0; i < 3; ++i) {
        // Not used, so it need not be a number: some write -1.#IND.
        word = takeWord(rest);
        if (word.empty() || equal(word, "outer")) failAt(bytes, word.data(), "a normal of three numbers expected");
      }
      expect(takeWord(rest), {"outer", "loop"});
      std::array<std::uint32_t, 3> corner;
      for (std::uint32_t& c : corner) {
        expect(takeWord(rest), {"vertex"});
        Eigen::Vector3d p;
        for (int i = 0; i < 3; ++i) p[i] = takeCoordinate(bytes, rest, "vertex " + std::to_string(vertices));
        ++vertices;
        c = pool.indexOf(p);
      }
      expect(takeWord(rest), {"endloop"});
      expect(takeWord(rest), {"endfacet"});
      polygons.addTriangle(corner[0], corner[1], corner[2]);
    }
    takeLine(rest, end);
  }
  return polygons;
}

}  // namespace

Polygons readStl(std::string_view bytes) {
  // Some binary files begin with "solid", too: their size tells, as the same bytes of a text are a huge number.
  const std::size_t count = bytes.size() >= kHead ? number<std::uint32_t>(bytes.substr(kHead - 4), false) : 0;
  const std::size_t needed = kHead + kFacet * count;
  if (bytes.size() >= kHead && bytes.size() == needed) return readBinary(bytes, count);
  const bool is_binary = bytes.size() >= kHead && bytes.size() > needed;
  std::string_view rest = withoutByteOrderMark(bytes);
  if (!is_binary && equal(takeWord(rest), "solid")) return readText(withoutByteOrderMark(bytes));
  // No binary file promises so many triangles as the bytes of a text: 150 million at least.
  const std::string_view head = bytes.substr(0, kHead);
  const bool is_text = std::all_of(head.begin(), head.end(), [](unsigned char c) {
    return c >= ' ' || kBlanks.find(static_cast<char>(c)) != std::string_view::npos;
  });
  if (bytes.size() < kHead || (is_text && bytes.size() < needed)) {
    throw std::runtime_error("no STL file: neither text that begins with 'solid' nor binary");
  }
  if (bytes.size() < needed) {
    throw std::runtime_error("truncated: " + std::to_string((bytes.size() - kHead) / kFacet) + " of " +
                             std::to_string(count) + " triangles");
  }
  throw std::runtime_error("byte " + std::to_string(needed) + ": there is more after the last triangle");
}

}  // namespace bocst::io
