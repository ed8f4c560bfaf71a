// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "polygons.h"
#include "text.h"

namespace bocst::io {

/// Reads a PLY file, text or binary. Our own reader, since assimp 5.2's rounds coordinates to float and fills what is
/// missing from a truncated file with repeated vertices and made-up indices.
/// @throws std::runtime_error saying what is wrong in which element.
class PlyReader {
 public:
  explicit PlyReader(std::string_view file) : rest_(file) {}

  Polygons read() {
    readHeader();
    for (const Element& element : elements_) {
      for (std::size_t i = 0; i < element.count; ++i) readElement(element, i);
    }
    if (!has_vertices_) throw std::runtime_error("no vertices with x, y and z in this PLY file");
    if (!has_faces_) throw std::runtime_error("no faces with vertex indices in this PLY file");
    for (std::size_t f = 0, c = 0; f < polygons_.ends.size(); ++f) {
      for (; c < polygons_.ends[f]; ++c) {
        if (!(indices_[c] >= 0 && indices_[c] < static_cast<double>(polygons_.vertices.size()))) {
          throw std::runtime_error("face " + std::to_string(f) + ": vertex index " +
                                   std::to_string(static_cast<long long>(indices_[c])) + " out of range, there are " +
                                   std::to_string(polygons_.vertices.size()) + " vertices");
        }
        polygons_.corners.push_back(static_cast<std::uint32_t>(indices_[c]));
      }
    }
    return std::move(polygons_);
  }

 private:
  enum class Format { kText, kLittleEndian, kBigEndian };
  enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
  enum class Role { kNone, kX, kY, kZ, kIndices };
  struct Property {
    Role role = Role::kNone;
    bool list = false;
    Type count_type = Type::kUint8;
    Type type = Type::kFloat;
  };
  struct Element {
    std::string name;
    std::size_t count = 0;
    std::vector<Property> properties;
  };

  static Type typeOf(std::string_view name) {
    static constexpr const char* kNames[8][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                                 {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                                 {"float", "float32"}, {"double", "float64"}};
    for (int i = 0; i < 8; ++i) {
      if (name == kNames[i][0] || name == kNames[i][1]) return static_cast<Type>(i);
    }
    throw std::runtime_error("PLY header: unknown type '" + std::string(name) + "'");
  }

  static Property propertyOf(const std::string& element, std::string_view line) {
    Property property;
    std::string_view word = takeWord(line);
    if (word == "list") {
      property.list = true;
      property.count_type = typeOf(takeWord(line));
      word = takeWord(line);
    }
    property.type = typeOf(word);
    const std::string_view name = takeWord(line);
    if (element == "vertex" && !property.list) {
      if (name == "x") property.role = Role::kX;
      if (name == "y") property.role = Role::kY;
      if (name == "z") property.role = Role::kZ;
    }
    if (element == "face" && property.list && (name == "vertex_indices" || name == "vertex_index")) {
      property.role = Role::kIndices;
    }
    return property;
  }

  void readHeader() {
    if (takeLine(rest_) != "ply") throw std::runtime_error("no PLY file: the first line is not 'ply'");
    bool has_format = false;
    while (true) {
      if (rest_.empty()) throw std::runtime_error("truncated: no end of the PLY header");
      std::string_view line = takeLine(rest_);
      const std::string_view word = takeWord(line);
      if (word == "end_header") break;
      if (word == "format") {
        const std::string_view format = takeWord(line);
        has_format = true;
        if (format == "binary_little_endian") {
          format_ = Format::kLittleEndian;
        } else if (format == "binary_big_endian") {
          format_ = Format::kBigEndian;
        } else if (format != "ascii") {
          throw std::runtime_error("PLY header: unknown format '" + std::string(format) + "'");
        }
      } else if (word == "element") {
        Element element;
        element.name = std::string(takeWord(line));
        long long count = -1;
        if (!takeNumber(line, count) || count < 0) {
          throw std::runtime_error("PLY header: number of elements expected after '" + element.name + "'");
        }
        element.count = static_cast<std::size_t>(count);
        elements_.push_back(element);
      } else if (word == "property" && !elements_.empty()) {
        elements_.back().properties.push_back(propertyOf(elements_.back().name, line));
      } else if (word != "comment" && word != "obj_info" && !word.empty()) {
        throw std::runtime_error("PLY header: unknown line '" + std::string(word) + "'");
      }
    }
    if (!has_format) throw std::runtime_error("PLY header: no format");
    for (const Element& element : elements_) {
      unsigned roles = 0;
      for (const Property& p : element.properties) roles |= 1u << static_cast<unsigned>(p.role);
      const bool vertices = (roles & 0b1110u) == 0b1110u;
      const bool faces = (roles & 0b10000u) != 0;
      has_vertices_ |= vertices;
      has_faces_ |= faces;
      // An element takes at least a byte: never reserve more than the file can hold.
      if (vertices) polygons_.vertices.reserve(std::min(element.count, rest_.size()));
      if (faces) polygons_.ends.reserve(std::min(element.count, rest_.size()));
      if (element.properties.empty() && element.count > 0) {
        throw std::runtime_error("PLY header: element '" + element.name + "' has no properties");
      }
    }
  }

  template <typename Raw>
  bool takeRaw(double& value) {
    if (rest_.size() < sizeof(Raw)) return false;
    unsigned char bytes[sizeof(Raw)];
    std::memcpy(bytes, rest_.data(), sizeof(Raw));
    rest_.remove_prefix(sizeof(Raw));
#if __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    if (format_ == Format::kBigEndian) std::reverse(bytes, bytes + sizeof(Raw));
#else
    if (format_ == Format::kLittleEndian) std::reverse(bytes, bytes + sizeof(Raw));
#endif
    Raw raw;
    std::memcpy(&raw, bytes, sizeof(Raw));
    value = static_cast<double>(raw);
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

  /// Every number of the body goes through here, so this is where truncation shows.
  double take(Type type, const Element& element, std::size_t i) {
    double value = 0;
    if (format_ != Format::kText) {
      if (takeBinary(type, value)) return value;
    } else {
      const std::string_view word = takeWord(rest_);
      if (!word.empty()) {
        if (toNumber(word, value)) return value;
        throw std::runtime_error(element.name + " " + std::to_string(i) + ": '" + std::string(word.substr(0, 32)) +
                                 "' is no number");
      }
    }
    throw std::runtime_error("truncated: the file ends in " + element.name + " " + std::to_string(i) + " of " +
                             std::to_string(element.count));
  }

  void readElement(const Element& element, std::size_t i) {
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    bool vertex = false;
    for (const Property& property : element.properties) {
      double n = 1;
      if (property.list) n = take(property.count_type, element, i);
      if (!(n >= 0)) throw std::runtime_error(element.name + " " + std::to_string(i) + ": negative list length");
      for (double k = 0; k < n; ++k) {
        const double value = take(property.type, element, i);
        switch (property.role) {
          case Role::kNone:
            break;
          case Role::kX:
            p.x() = value;
            break;
          case Role::kY:
            p.y() = value;
            break;
          case Role::kZ:
            p.z() = value;
            vertex = true;
            break;
          case Role::kIndices:
            indices_.push_back(value);
            break;
        }
      }
      if (property.role == Role::kIndices) polygons_.ends.push_back(indices_.size());
    }
    if (vertex) polygons_.vertices.push_back(p);
  }

  std::string_view rest_;
  Format format_ = Format::kText;
  std::vector<Element> elements_;
  bool has_vertices_ = false;
  bool has_faces_ = false;
  std::vector<double> indices_;  // checked when all vertices are known, which may come after the faces
  Polygons polygons_;
};

}  // namespace bocst::io
