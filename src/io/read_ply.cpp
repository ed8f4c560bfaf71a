// SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "io/binary.h"
#include "io/read_mesh.h"
#include "io/text.h"

namespace bocst::io {
namespace {

/// Text or binary; faces, triangle strips or both.
class PlyReader {
 public:
  explicit PlyReader(std::string_view file) : file_(file), rest_(file) {}

  Polygons read() {
    readHeader();
    for (const Element& element : elements_) {
      for (std::size_t i = 0; i < element.count; ++i) readElement(element, i);
    }
    if (format_ == Format::kText) rest_.remove_prefix(std::min(rest_.find_first_not_of(kBlanks), rest_.size()));
    if (!rest_.empty()) fail(rest_.data(), "there is more after the last element");
    return std::move(polygons_);
  }

 private:
  enum class Format { kText, kLittleEndian, kBigEndian };
  enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
  enum class Role { kNone, kX, kY, kZ, kFace, kStrips };
  struct Property {
    Role role = Role::kNone;
    bool list = false;
    Type count_type = Type::kUint8;
    Type type = Type::kFloat;
    std::string name;
  };
  struct Element {
    std::string name;
    std::size_t count = 0;
    std::vector<Property> properties;
  };
  static constexpr double kLowest[] = {-128, 0, -32768, 0, -2147483648.0, 0};
  static constexpr double kHighest[] = {127, 255, 32767, 65535, 2147483647, 4294967295.0};

  /// The header and text are counted in lines, binary data in bytes.
  [[noreturn]] void fail(const char* at, const std::string& what) const {
    if (in_header_ || format_ == Format::kText) failAt(file_, at, what);
    throw std::runtime_error("byte " + std::to_string(at - file_.data()) + ": " + what);
  }

  Type typeOf(std::string_view name) const {
    static constexpr const char* kNames[8][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                                 {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                                 {"float", "float32"}, {"double", "float64"}};
    for (int i = 0; i < 8; ++i) {
      if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Type>(i);
    }
    fail(name.data(), "PLY header: unknown type " + inQuotes(name));
  }

  Property propertyOf(const Element& element, std::string_view line) const {
    Property property;
    std::string_view word = takeWord(line);
    if (word == "list") {
      property.list = true;
      property.count_type = typeOf(takeWord(line));
      word = takeWord(line);
    }
    property.type = typeOf(word);
    const std::string_view name = takeWord(line);
    property.name = name;
    if (element.name == "vertex" && !property.list) {
      if (name == "x") property.role = Role::kX;
      if (name == "y") property.role = Role::kY;
      if (name == "z") property.role = Role::kZ;
    }
    if (property.list && (name == "vertex_indices" || name == "vertex_index")) {
      if (element.name == "face") property.role = Role::kFace;
      if (element.name == "tristrips") property.role = Role::kStrips;
    }
    for (const Property& other : element.properties) {
      const bool again = property.role != Role::kNone && other.role == property.role;
      if (other.name == property.name || again) fail(name.data(), "PLY header: twice the property " + inQuotes(name));
    }
    return property;
  }

  void readHeader() {
    // Lines that end with CR alone: a line feed after one of them belongs to binary data.
    const char end = file_.substr(0, 4) == "ply\r" && file_.substr(4, 1) != "\n" ? '\r' : '\n';
    if (takeLine(rest_, end) != "ply") throw std::runtime_error("no PLY file: the first line is not 'ply'");
    bool has_format = false;
    while (true) {
      if (rest_.empty()) throw std::runtime_error("truncated: no end of the PLY header");
      std::string_view line = takeLine(rest_, end);
      const std::string_view word = takeWord(line);
      if (word == "end_header") break;
      if (word == "format") {
        if (has_format) fail(word.data(), "PLY header: a second format");
        const std::string_view format = takeWord(line);
        if (format == "binary_little_endian") {
          format_ = Format::kLittleEndian;
        } else if (format == "binary_big_endian") {
          format_ = Format::kBigEndian;
        } else if (format != "ascii") {
          fail(format.data(), "PLY header: unknown format " + inQuotes(format));
        }
        has_format = true;
      } else if (word == "element") {
        const std::string_view name = takeWord(line);
        for (const Element& other : elements_) {
          if (other.name == name) fail(name.data(), "PLY header: twice the element " + inQuotes(name));
        }
        long long count = -1;
        if (!takeNumber(line, count) || count < 0) {
          fail(name.data(), "PLY header: number of elements expected after " + inQuotes(name));
        }
        elements_.push_back({std::string(name), static_cast<std::size_t>(count), {}});
      } else if (word == "property" && !elements_.empty()) {
        elements_.back().properties.push_back(propertyOf(elements_.back(), line));
      } else if (word != "comment" && word != "obj_info" && !word.empty()) {
        fail(word.data(), "PLY header: unknown line " + inQuotes(word));
      }
    }
    if (!has_format) throw std::runtime_error("PLY header: no format");
    checkElements();
    in_header_ = false;
  }

  void checkElements() {
    unsigned roles = 0;
    for (const Element& element : elements_) {
      for (const Property& p : element.properties) roles |= 1u << static_cast<unsigned>(p.role);
      // An element takes at least a byte: never reserve more than the file can hold.
      if (element.name == "vertex") {
        vertex_count_ = element.count;
        polygons_.vertices.reserve(std::min(element.count, rest_.size()));
      }
      if (element.name == "face") polygons_.ends.reserve(std::min(element.count, rest_.size()));
      if (element.properties.empty() && element.count > 0) {
        throw std::runtime_error("PLY header: element " + inQuotes(element.name) + " has no properties");
      }
    }
    if ((roles & 0b1110u) != 0b1110u) throw std::runtime_error("no vertices with x, y and z in this PLY file");
    if ((roles & 0b110000u) == 0) throw std::runtime_error("no faces with vertex indices in this PLY file");
  }

  template <typename Raw>
  bool takeRaw(double& value) {
    if (rest_.size() < sizeof(Raw)) return false;
    value = static_cast<double>(number<Raw>(rest_, format_ == Format::kBigEndian));
    rest_.remove_prefix(sizeof(Raw));
    return true;
  }

  bool takeBinary(Type type, double& value) {
    switch (type) {
      case Type::kInt8:
        return takeRaw<std::int8_t>(value);
      case Type::kUint8:
        return takeRaw<std::uint8_t>(value);
      case Type::kInt16:
        return takeRaw<std::int16_t>(value);
      case Type::kUint16:
        return takeRaw<std::uint16_t>(value);
      case Type::kInt32:
        return takeRaw<std::int32_t>(value);
      case Type::kUint32:
        return takeRaw<std::uint32_t>(value);
      case Type::kFloat:
        return takeRaw<float>(value);
      case Type::kDouble:
        return takeRaw<double>(value);
    }
    return false;
  }

  static std::string nameOf(const Element& element, std::size_t i) { return element.name + " " + std::to_string(i); }

  /// Every number of the body goes through here, so this is where truncation shows.
  double take(Type type, const Element& element, std::size_t i) {
    double value = 0;
    last_ = rest_.data();
    if (format_ != Format::kText) {
      if (takeBinary(type, value)) return value;
    } else {
      const std::string_view word = takeWord(rest_);
      last_ = word.data();
      if (!word.empty()) {
        const auto t = static_cast<std::size_t>(type);
        const bool real = type == Type::kFloat || type == Type::kDouble;
        if (toNumber(word, value)) {
          if (real || (value == std::floor(value) && value >= kLowest[t] && value <= kHighest[t])) return value;
        }
        fail(last_, nameOf(element, i) + ": " + inQuotes(word) + " is no number of its property's type");
      }
    }
    throw std::runtime_error("truncated: the file ends in " + nameOf(element, i) + " of " +
                             std::to_string(element.count));
  }

  void takeIndex(const Property& property, const Element& element, std::size_t i) {
    const double value = take(property.type, element, i);
    if (property.role == Role::kNone) return;
    if (property.role == Role::kStrips && value == -1) {  // ends a strip
      polygons_.addStrip(indices_.data(), indices_.size());
      indices_.clear();
      return;
    }
    if (!(value >= 0 && value < static_cast<double>(vertex_count_) && value == std::floor(value))) {
      char shown[32];
      *std::to_chars(shown, shown + sizeof(shown) - 1, value).ptr = 0;
      fail(last_, nameOf(element, i) + ": vertex index " + shown + " out of range, there are " +
                      std::to_string(vertex_count_) + " vertices");
    }
    indices_.push_back(static_cast<std::uint32_t>(value));
  }

  void readList(const Property& property, const Element& element, std::size_t i) {
    const double n = take(property.count_type, element, i);
    if (!(n >= 0 && n == std::floor(n))) fail(last_, nameOf(element, i) + ": a list length that is no count");
    if (n > static_cast<double>(rest_.size())) fail(last_, nameOf(element, i) + ": a list longer than the file");
    indices_.clear();
    for (auto k = static_cast<std::size_t>(n); k > 0; --k) takeIndex(property, element, i);
    if (property.role == Role::kFace) {
      polygons_.corners.insert(polygons_.corners.end(), indices_.begin(), indices_.end());
      polygons_.ends.push_back(polygons_.corners.size());
    }
    if (property.role == Role::kStrips) polygons_.addStrip(indices_.data(), indices_.size());
  }

  void readElement(const Element& element, std::size_t i) {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (const Property& property : element.properties) {
      if (property.list) {
        readList(property, element, i);
        continue;
      }
      const double value = take(property.type, element, i);
      if (property.role == Role::kNone) continue;
      if (const char* fault = notACoordinate(value)) fail(last_, nameOf(element, i) + ": a coordinate " + fault);
      p[static_cast<int>(property.role) - static_cast<int>(Role::kX)] = value;
    }
    if (element.name == "vertex") polygons_.vertices.push_back(p);
  }

  std::string_view file_;
  std::string_view rest_;
  const char* last_ = nullptr;  // where the last number begins
  bool in_header_ = true;
  Format format_ = Format::kText;
  std::vector<Element> elements_;
  std::size_t vertex_count_ = 0;
  std::vector<std::uint32_t> indices_;  // of the list that is being read
  Polygons polygons_;
};

}  // namespace

Polygons readPly(std::string_view bytes) { return PlyReader(bytes).read(); }

}  // namespace bocst::io
