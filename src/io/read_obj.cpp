// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "io/read_mesh.h"
#include "io/text.h"
#include "mesh/limits.h"

namespace bocst::io {
namespace {

/// Statements about something else than vertices and faces; "#" begins a comment.
constexpr std::string_view kIgnored[] = {"vn",     "vt",       "vp",       "g",          "o",         "s",      "mg",
                                         "usemtl", "mtllib",   "usemap",   "maplib",     "p",         "l",      "bevel",
                                         "lod",    "c_interp", "d_interp", "shadow_obj", "trace_obj", "cstype", "deg",
                                         "bmat",   "step",     "curv",     "curv2",      "parm",      "trim",   "hole",
                                         "scrv",   "sp",       "end",      "con",        "ctech",     "stech"};

class ObjReader {
 public:
  explicit ObjReader(std::string_view bytes) : bytes_(bytes) {}

  Polygons read() {
    std::string_view rest = bytes_;
    const char end = lineEnd(bytes_);
    while (!rest.empty()) {
      std::string_view line = takeLine(rest, end);
      // A backslash at the end of a line, except in a comment, joins it with the next line; takeWord() takes ends of
      // lines for blanks.
      while (!line.empty() && line.back() == '\\' && line.find('#') == line.npos && !rest.empty()) {
        const std::string_view more = takeLine(rest, end);
        line = {line.data(), static_cast<std::size_t>(more.data() + more.size() - line.data())};
      }
      readStatement(line.substr(0, line.find('#')));
    }
    if (highest_ >= vertices()) failAt(bytes_, highest_at_, outOfRange(highest_ + 1));
    return std::move(polygons_);
  }

 private:
  long long vertices() const { return static_cast<long long>(polygons_.vertices.size()); }

  std::string outOfRange(long long index) const {
    return "vertex index " + std::to_string(index) + " out of range, there are " + std::to_string(vertices()) +
           " vertices" + (index == 0 ? ", and OBJ counts from 1" : "");
  }

  /// The next word that is not the backslash between two lines.
  static std::string_view nextWord(std::string_view& line) {
    std::string_view word = takeWord(line);
    while (word == "\\") word = takeWord(line);
    if (!word.empty() && word.back() == '\\') word.remove_suffix(1);
    return word;
  }

  void readStatement(std::string_view line) {
    const std::string_view keyword = nextWord(line);
    if (keyword.empty()) return;
    if (keyword == "v") {
      readVertex(line);
    } else if (keyword == "f" || keyword == "fo") {
      readFace(line, keyword.data());
    } else if (std::find(std::begin(kIgnored), std::end(kIgnored), keyword) == std::end(kIgnored)) {
      failAt(bytes_, keyword.data(),
             keyword == "surf" ? "free-form surfaces are not supported" : "no OBJ statement: " + inQuotes(keyword));
    }
  }

  /// x y z, then nothing, or w, or a colour of three or four numbers.
  void readVertex(std::string_view line) {
    double numbers[7];
    std::size_t n = 0;
    const std::string what = "vertex " + std::to_string(vertices());
    for (std::string_view word = nextWord(line); !word.empty() || n < 3; word = nextWord(line)) {
      if (n == 7) failAt(bytes_, word.data(), what + ": too many numbers");
      std::string_view number = word;
      numbers[n++] = takeCoordinate(bytes_, number, what);
    }
    Eigen::Vector3d p(numbers[0], numbers[1], numbers[2]);
    if (n == 5) failAt(bytes_, line.data(), what + ": 3, 4, 6 or 7 numbers expected");
    const double w = n == 4 ? numbers[3] : 1;
    if (w == 0) failAt(bytes_, line.data(), what + ": lies at infinity (w is 0)");
    if (w != 1) p /= w;
    if (!(p.cwiseAbs().maxCoeff() <= kMostCoordinate)) {
      failAt(bytes_, line.data(), what + ": a coordinate divided by w is larger than 1e75 in magnitude");
    }
    polygons_.vertices.push_back(p);
  }

  /// Corners as v, v/vt, v//vn or v/vt/vn.
  void readFace(std::string_view line, const char* at) {
    std::size_t corners = 0;
    for (std::string_view word = nextWord(line); !word.empty(); word = nextWord(line), ++corners) {
      long long index = 0;
      long long ignored = 0;
      bool good = toNumber(word.substr(0, word.find('/')), index);
      std::string_view rest = word;
      for (int part = 0; good && rest.find('/') != std::string_view::npos; ++part) {
        rest.remove_prefix(rest.find('/') + 1);
        const std::string_view number = rest.substr(0, rest.find('/'));
        const bool may_miss = part == 0;  // v//vn; some write v/ and v//, too
        good = part < 2 && (toNumber(number, ignored) || (number.empty() && (may_miss || rest.empty())));
      }
      if (!good) failAt(bytes_, word.data(), inQuotes(word) + " is no corner of a face");
      const long long absolute = index < 0 ? vertices() + index : index - 1;
      if (absolute < 0 || absolute >= std::numeric_limits<std::uint32_t>::max()) {
        failAt(bytes_, word.data(), outOfRange(index));
      }
      if (absolute > highest_) {
        highest_ = absolute;
        highest_at_ = word.data();
      }
      polygons_.corners.push_back(static_cast<std::uint32_t>(absolute));
    }
    if (corners < 3) failAt(bytes_, at, "a face has at least three corners");
    polygons_.ends.push_back(polygons_.corners.size());
  }

  std::string_view bytes_;
  Polygons polygons_;
  long long highest_ = -1;  // vertices may come after the faces that use them
  const char* highest_at_ = nullptr;
};

}  // namespace

Polygons readObj(std::string_view bytes) { return ObjReader(bytes).read(); }

}  // namespace bocst::io
