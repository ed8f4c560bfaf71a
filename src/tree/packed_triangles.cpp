// SPDX-License-Identifier: BSD-3-Clause
#include "tree/packed_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

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

std::size_t PackedTriangles::words(std::size_t count, std::size_t places) {
  constexpr std::size_t kLanes = 8;
  const std::size_t steps = 3 * places * sizeof(std::uint16_t), corners = 3 * count;
  const std::size_t read = std::max(steps + (kLanes - 1) * sizeof(std::uint16_t), steps + corners + kLanes - 1);
  return kHeader + (read + sizeof(std::uint32_t) - 1) / sizeof(std::uint32_t);
}

std::vector<std::uint32_t> PackedTriangles::pack(const oracle::Surface& surface,
                                                 const std::vector<std::uint32_t>& ids) {
  // Each vertex is placed once; vertices of soups share places, too.
  Numbers vertices;
  std::array<std::uint8_t, kMostPlaces> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < ids.size(); ++i) {
      corners[k * ids.size() + i] = vertices.number(surface.mesh->indices(ids[i])[k]);
    }
  }
  std::array<Eigen::Vector3d, kMostPlaces> places;
  Eigen::AlignedBox3d box;
  for (std::size_t i = 0; i < vertices.count(); ++i) {
    places[i] = surface.lattice.toLattice(surface.mesh->vertex(vertices.key(i)));
    box.extend(places[i]);
  }
  // The surface lies in the lattice, but for rounding.
  const Eigen::Vector3d origin = box.min().array().floor().max(0.0).min(kMost);
  const double extent = (box.max() - origin).maxCoeff();
  const int exponent = static_cast<int>(std::ceil(std::log2(std::max(extent, 0x1p-8) / kMost)));
  const double inverse_step = std::ldexp(1.0, -exponent);

  const auto stepsOf = [&](const Eigen::Vector3d& place) {
    std::uint64_t all = 0;
    for (int c = 2; c >= 0; --c) {
      const double exact = std::min(std::max((place[c] - origin[c]) * inverse_step, 0.0), kMost);
      all = all << 16 | static_cast<std::uint16_t>(exact + 0.5);
    }
    return all;
  };
  Numbers different;
  std::array<std::uint8_t, kMostPlaces> place_of;
  for (std::size_t i = 0; i < vertices.count(); ++i) place_of[i] = different.number(stepsOf(places[i]));
  const std::size_t count = different.count();

  std::vector<std::uint32_t> words(PackedTriangles::words(ids.size(), count));
  const auto at = [&origin](int k) { return static_cast<std::uint32_t>(origin[k]); };
  words[0] =
      static_cast<std::uint32_t>(count) | static_cast<std::uint32_t>(exponent + kExponentBias) << 8 | at(0) << 16;
  words[1] = at(1) | at(2) << 16;
  auto* to = reinterpret_cast<char*>(words.data() + kHeader);
  for (int c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < count; ++i) {
      const auto step = static_cast<std::uint16_t>(different.key(i) >> 16 * c);
      std::memcpy(to, &step, sizeof(step));
      to += sizeof(step);
    }
  }
  for (std::size_t i = 0; i < 3 * ids.size(); ++i) *to++ = static_cast<char>(place_of[corners[i]]);
  return words;
}

}  // namespace bocst::tree
