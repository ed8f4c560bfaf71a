// SPDX-License-Identifier: BSD-3-Clause
#include "tree/packed_triangles.h"

#include <algorithm>
#include <array>
#include <cstring>

namespace bocst::tree {

namespace {

// Numbers at most kMostPlaces different keys in the order in which they come.
class Numbers {
 public:
  Numbers() { slots_.fill(kFree); }

  std::uint8_t number(std::uint64_t key) {
    // Where a slot is free, its number is that of the new key, which is there already: the only branch is hardly taken.
    keys_[count_] = key;
    std::size_t at = key * 0x9e3779b97f4a7c15u >> 56, number = std::min<std::size_t>(slots_[at], count_);
    while (keys_[number] != key) {
      at = (at + 1) % kSlots;
      number = std::min<std::size_t>(slots_[at], count_);
    }
    slots_[at] = static_cast<std::uint8_t>(number);
    count_ += number == count_;
    return static_cast<std::uint8_t>(number);
  }
  std::size_t count() const { return count_; }
  std::uint64_t key(std::size_t number) const { return keys_[number]; }

 private:
  static constexpr std::size_t kSlots = 256;
  static constexpr std::uint8_t kFree = 0xff;
  std::array<std::uint8_t, kSlots> slots_;
  std::array<std::uint64_t, PackedTriangles::kMostPlaces + 1> keys_;
  std::size_t count_ = 0;
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

std::size_t PackedTriangles::pack(const CornerRows& rows, std::size_t begin, std::size_t triangles,
                                  const float (&base)[3], Words& words) {
  static_assert(PackedTriangles::words(kMostTriangles, kMostPlaces) <= std::tuple_size<Words>::value,
                "all packs have room");
  LeafGrid grid;
  CornerSteps steps;
  if (!stepsOnGrid(rows, begin, triangles, base, grid, steps)) return 0;
  Numbers places;
  std::array<std::uint8_t, kMostPlaces> corners;
  for (std::size_t i = 0; i < triangles; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t x = steps[3 * k][i], y = steps[3 * k + 1][i], z = steps[3 * k + 2][i];
      corners[k * triangles + i] = places.number(x | y << 16 | z << 32);
    }
  }
  std::uint32_t exponent;
  std::memcpy(&exponent, &grid.step, sizeof(exponent));
  const auto at = [&grid](std::size_t k) { return static_cast<std::uint32_t>(grid.origin[k]); };
  const std::size_t count = places.count(), size = PackedTriangles::words(triangles, count);
  words[0] = static_cast<std::uint32_t>(count) | exponent >> 23 << 8 | at(0) << 16;
  words[1] = at(1) | at(2) << 16;
  std::fill_n(words.begin() + static_cast<std::ptrdiff_t>(size) - 3, 3, 0u);  // what no corner fills
  std::array<std::uint16_t, 3 * kMostPlaces> places_by_axis;
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t i = 0; i < count; ++i) {
      places_by_axis[c * count + i] = static_cast<std::uint16_t>(places.key(i) >> (16 * c));
    }
  }
  auto* const to = reinterpret_cast<char*>(words.data() + kHeader);
  std::memcpy(to, places_by_axis.data(), 3 * count * sizeof(places_by_axis[0]));
  std::memcpy(to + 3 * count * sizeof(places_by_axis[0]), corners.data(), 3 * triangles);
  return size;
}

}  // namespace bocst::tree
