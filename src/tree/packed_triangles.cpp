// SPDX-License-Identifier: BSD-3-Clause
#include "tree/packed_triangles.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace bocst::tree {

namespace {

constexpr double kMost = 65535;
constexpr int kExponentBias = 127;  // that of a float, 23 bits up

using Place = std::array<std::uint16_t, 3>;

Place placeOf(const Eigen::Vector3d& at) {
  const auto q = [&at](int c) { return static_cast<std::uint16_t>(std::clamp(std::round(at[c]), 0.0, kMost)); };
  return {q(0), q(1), q(2)};
}

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
  Eigen::AlignedBox3d box;
  for (const std::uint32_t t : ids) {
    for (int k = 0; k < 3; ++k) box.extend(surface.corner(t, k));
  }
  // The surface lies in the lattice, but for rounding.
  const Eigen::Vector3d origin = box.min().array().floor().max(0.0).min(kMost);
  const double extent = (box.max() - origin).maxCoeff();
  const int exponent = static_cast<int>(std::ceil(std::log2(std::max(extent, 0x1p-8) / kMost)));
  const double inverse_step = std::ldexp(1.0, -exponent);

  std::vector<Place> places;
  std::vector<std::uint8_t> corners;
  places.reserve(kMostPlaces);
  for (int k = 0; k < 3; ++k) {
    for (const std::uint32_t t : ids) {
      const Place place = placeOf((surface.corner(t, k) - origin) * inverse_step);
      const auto known = std::find(places.begin(), places.end(), place);
      corners.push_back(static_cast<std::uint8_t>(known - places.begin()));
      if (known == places.end()) places.push_back(place);
    }
  }

  std::vector<std::uint32_t> words(PackedTriangles::words(ids.size(), places.size()));
  const auto at = [&origin](int k) { return static_cast<std::uint32_t>(origin[k]); };
  words[0] = static_cast<std::uint32_t>(places.size()) | static_cast<std::uint32_t>(exponent + kExponentBias) << 8 |
             at(0) << 16;
  words[1] = at(1) | at(2) << 16;
  auto* to = reinterpret_cast<char*>(words.data() + kHeader);
  for (std::size_t c = 0; c < 3; ++c) {
    for (const Place& place : places) {
      std::memcpy(to, &place[c], sizeof(place[c]));
      to += sizeof(place[c]);
    }
  }
  std::memcpy(to, corners.data(), corners.size());
  return words;
}

}  // namespace bocst::tree
