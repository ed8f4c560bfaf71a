// SPDX-License-Identifier: BSD-3-Clause
#include "tree/packed_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <tuple>

namespace bocst::tree {

namespace {

constexpr int kExponentBias = 127;  // that of a float, 23 bits up

// Numbers at most kMostPlaces different keys in the order in which they come.
class Numbers {
 public:
  std::uint8_t number(std::uint64_t key) {
    for (std::size_t at = key * 0x9e3779b97f4a7c15u >> 56;; at = (at + 1) % kSlots) {
      const std::uint8_t found = slots_[at];
      if (found == kFree) {
        slots_[at] = static_cast<std::uint8_t>(count_);
        keys_[count_] = key;
        return static_cast<std::uint8_t>(count_++);
      }
      if (keys_[found] == key) return found;
    }
  }
  std::size_t count() const { return count_; }
  std::uint64_t key(std::size_t number) const { return keys_[number]; }

 private:
  static constexpr std::size_t kSlots = 256;
  static constexpr std::uint8_t kFree = 0xff;
  std::array<std::uint8_t, kSlots> slots_ = filled();
  std::array<std::uint64_t, PackedTriangles::kMostPlaces> keys_;
  std::size_t count_ = 0;

  static std::array<std::uint8_t, kSlots> filled() {
    std::array<std::uint8_t, kSlots> slots;
    slots.fill(kFree);
    return slots;
  }
};

}  // namespace

PackedTriangles::PackedTriangles(const std::uint32_t* words, std::size_t count_)
    : count(count_), places(words[0] & 0xff) {
  origin[0] = static_cast<float>(words[0] >> 16);
  origin[1] = static_cast<float>(words[1] & 0xffff);
  origin[2] = static_cast<float>(words[1] >> 16);
  const std::uint32_t bits = (words[0] >> 8 & 0xff) << 23;
  std::memcpy(&step, &bits, sizeof(step));
  steps = reinterpret_cast<const std::uint16_t*>(words + kHeader);
  corners = reinterpret_cast<const std::uint8_t*>(steps + 3 * places);
}

std::size_t PackedTriangles::pack(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t triangles,
                                  Words& words) {
  static_assert(PackedTriangles::words(kMostTriangles, kMostPlaces) <= std::tuple_size<Words>::value,
                "all packs have room");
  Numbers vertices;
  std::array<std::uint8_t, kMostPlaces> corners;
  for (std::size_t i = 0; i < triangles; ++i) {
    const Mesh::Indices& indices = surface.mesh->indices(ids[i]);
    for (std::size_t k = 0; k < 3; ++k) corners[k * triangles + i] = vertices.number(indices[k]);
  }
  std::size_t count = vertices.count();
  std::array<Eigen::Array3d, kMostPlaces> places;
  Eigen::Array3d least = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity()), most = -least;
  for (std::size_t i = 0; i < count; ++i) {
    places[i] = surface.lattice.toLattice(surface.mesh->vertex(vertices.key(i))).array();
    least = least.min(places[i]);
    most = most.max(places[i]);
  }
  // The surface lies in the lattice, but for rounding.
  const Eigen::Array3d origin = least.floor().max(0.0).min(kMost);
  const double extent = (most - origin).maxCoeff();
  // The least power of two with which kMost steps reach.
  int exponent;
  const double mantissa = std::frexp(std::max(extent, 0x1p-8) / kMost, &exponent);
  if (mantissa == 0.5) --exponent;
  const double inverse_step = std::ldexp(1.0, -exponent);

  std::array<std::array<std::uint16_t, 3>, kMostPlaces> steps;
  for (std::size_t i = 0; i < count; ++i) {
    const Eigen::Array3d exact = ((places[i] - origin) * inverse_step).max(0.0).min(kMost) + 0.5;
    for (std::size_t c = 0; c < 3; ++c) {
      steps[i][c] = static_cast<std::uint16_t>(exact[static_cast<Eigen::Index>(c)]);
    }
  }
  // The vertices of a soup share places: a surface has about as many vertices as triangles.
  if (count > triangles + triangles / 2) {
    Numbers different;
    std::array<std::uint8_t, kMostPlaces> place_of;
    for (std::size_t i = 0; i < count; ++i) {
      const std::array<std::uint16_t, 3> own = steps[i];
      place_of[i] = different.number(own[0] | std::uint64_t{own[1]} << 16 | std::uint64_t{own[2]} << 32);
      steps[place_of[i]] = own;  // never after those that are still to be read
    }
    count = different.count();
    for (std::size_t i = 0; i < 3 * triangles; ++i) corners[i] = place_of[corners[i]];
  }

  const auto at = [&origin](int k) { return static_cast<std::uint32_t>(origin[k]); };
  words[0] =
      static_cast<std::uint32_t>(count) | static_cast<std::uint32_t>(exponent + kExponentBias) << 8 | at(0) << 16;
  words[1] = at(1) | at(2) << 16;
  const std::size_t size = PackedTriangles::words(triangles, count);
  std::fill(words.begin() + kHeader, words.begin() + static_cast<std::ptrdiff_t>(size), 0);
  auto* to = reinterpret_cast<char*>(words.data() + kHeader);
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < count; ++i, to += sizeof(std::uint16_t)) {
      std::memcpy(to, &steps[i][c], sizeof(std::uint16_t));
    }
  }
  std::memcpy(to, corners.data(), 3 * triangles);
  return size;
}

}  // namespace bocst::tree
