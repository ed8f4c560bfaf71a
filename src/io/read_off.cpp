// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "io/read_mesh.h"
#include "io/text.h"

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

class OffReader {
 public:
  /// Free form: numbers go on from line to line, and nothing else follows those of a vertex or a face.
  OffReader(std::string_view bytes, bool free_form)
      : bytes_(bytes), text_(bytes), line_end_(lineEnd(bytes)), free_form_(free_form) {}

  Polygons read() {
    readHeader();
    if (free_form_ && linesLeft() - vertex_count_ == face_count_) fail("a line for each vertex and face");
    // Each vertex and each face takes a line: never reserve more than the file can hold.
    const auto bytes_left = static_cast<long long>(text_.size());
    polygons_.vertices.reserve(static_cast<std::size_t>(std::min(vertex_count_, bytes_left)));
    for (long long v = 0; v < vertex_count_; ++v) readVertex(v);
    polygons_.ends.reserve(static_cast<std::size_t>(std::min(face_count_, bytes_left)));
    for (long long f = 0; f < face_count_; ++f) readFace(f);
    if (more()) fail("there is more after the last face");
    return std::move(polygons_);
  }

 private:
  // Goes on to the next line that says something: comments and blank lines do not count.
  bool nextLine() {
    while (!text_.empty()) {
      line_ = takeLine(text_, line_end_);
      line_ = line_.substr(0, line_.find('#'));
      if (!isBlank(line_)) return true;
    }
    return false;
  }
  /// Goes on to what comes next: another line, or in free form the rest of this one.
  bool more() { return (free_form_ && !isBlank(line_)) || nextLine(); }
  void more(long long found, long long promised, const char* what) {
    if (more()) return;
    throw std::runtime_error("truncated: " + std::to_string(found) + " of " + std::to_string(promised) + " " + what);
  }

  long long linesLeft() {
    const std::string_view line = line_, text = text_;
    long long lines = isBlank(line_) ? 0 : 1;
    while (nextLine()) ++lines;
    line_ = line;
    text_ = text;
    return lines;
  }

  [[noreturn]] void fail(const std::string& what) const { failAt(bytes_, line_.data(), what); }

  void readHeader() {
    if (!nextLine()) throw std::runtime_error("no OFF file: nothing but blank lines");
    // The keyword is [ST][C][N][4][n]OFF and may be missing.
    std::string_view rest = line_;
    const std::string_view keyword = takeWord(rest);
    if (keyword.size() >= 3 && keyword.substr(keyword.size() - 3) == "OFF") {
      if (free_form_ && keyword != "OFF") fail("more than coordinates in free form");
      if (keyword.find_first_not_of("STCNOF") != std::string_view::npos) {
        fail("only three-dimensional OFF is supported");
      }
      line_ = rest;
      if (takeWord(rest) == "BINARY") fail("binary OFF is not supported");
      if (isBlank(line_) && !nextLine()) fail("truncated: no numbers of vertices and faces");
    }
    if (!takeNumber(line_, vertex_count_) || !takeNumber(line_, face_count_) || vertex_count_ < 0 || face_count_ < 0) {
      fail("no OFF file: numbers of vertices and faces expected");
    }
    long long edge_count = 0;  // not used, often 0
    if (!isBlank(line_) && (!takeNumber(line_, edge_count) || !(free_form_ || isBlank(line_)))) {
      fail("numbers of vertices, faces and edges expected, and nothing else");
    }
  }

  void readVertex(long long v) {
    more(v, vertex_count_, "vertices");
    Eigen::Vector3d p;
    for (int i = 0; i < 3; ++i) {
      if (free_form_) more();
      p[i] = takeCoordinate(bytes_, line_, "vertex " + std::to_string(v));
    }
    if (!free_form_) checkExtras(bytes_, line_, 9);
    polygons_.vertices.push_back(p);
  }

  void readFace(long long f) {
    more(f, face_count_, "faces");
    const auto face = [f] { return "face " + std::to_string(f) + ": "; };
    long long n = 0;
    if (!takeNumber(line_, n) || n < (free_form_ ? 1 : 0)) fail(face() + "number of corners expected");
    for (long long i = 0; i < n; ++i) {
      long long index = 0;
      if (free_form_) more();
      if (!takeNumber(line_, index)) fail(face() + std::to_string(n) + " vertex indices expected");
      if (index < 0 || index >= vertex_count_) {
        fail(face() + "vertex index " + std::to_string(index) + " out of range, there are " +
             std::to_string(vertex_count_) + " vertices");
      }
      polygons_.corners.push_back(static_cast<std::uint32_t>(index));
    }
    if (!free_form_) checkExtras(bytes_, line_, 4);
    polygons_.ends.push_back(polygons_.corners.size());
  }

  const std::string_view bytes_;
  std::string_view text_, line_;  // what is not read yet; of the current line, too
  const char line_end_;
  const bool free_form_;
  long long vertex_count_ = 0, face_count_ = 0;
  Polygons polygons_;
};

}  // namespace

Polygons readOff(std::string_view bytes) {
  try {
    return OffReader(bytes, false).read();
  } catch (const std::runtime_error&) {
    // Geomview takes several vertices or faces in a line, too. Messages are those for a line each.
    try {
      return OffReader(bytes, true).read();
    } catch (const std::runtime_error&) {
    }
    throw;
  }
}

}  // namespace bocst::io
