// SPDX-License-Identifier: BSD-3-Clause
#include "tree/triangle_lists.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "log/assert.h"

namespace bocst::tree {

void TriangleList::appendTo(std::vector<std::uint32_t>& all) const {
  all.reserve(all.size() + count);
  for (std::size_t i = 0; i < count; ++i) all.push_back(ids[i]);
}

std::size_t TriangleLists::idWords(std::uint32_t flags) {
  const std::size_t count = flags & kCount;
  return (flags & kNarrow) != 0 ? 1 + (count + 1) / 2 : count;
}

std::uint32_t TriangleLists::add(const std::uint32_t* ids, std::size_t count) {
  if (count > kCount) throw std::length_error("bocst: a node of more than 2^29 triangles");
  auto flags = static_cast<std::uint32_t>(count);
  std::uint32_t least = 0;
  if (count > 1) {
    const auto [lowest, highest] = std::minmax_element(ids, ids + count);
    least = *lowest;
    if (*highest - least <= 0xffff) flags |= kNarrow;
  }
  const std::uint32_t index = words_.append(1 + idWords(flags));
  std::uint32_t* const words = &words_[index];
  words[0] = flags;
  if ((flags & kNarrow) == 0) {
    std::copy_n(ids, count, words + 1);
    return index;
  }
  words[1] = least;
  auto* const steps = reinterpret_cast<char*>(words + 2);
  for (std::size_t i = 0; i < count; ++i) {
    const auto step = static_cast<std::uint16_t>(ids[i] - least);
    std::memcpy(steps + i * sizeof(step), &step, sizeof(step));
  }
  return index;
}

std::uint32_t TriangleLists::addDeviceList(std::size_t count, Place place) {
  if (count > kCount) throw std::length_error("bocst: a node of more than 2^29 triangles");
  const std::uint32_t index = words_.append(kDeviceListWords);
  words_[index] = static_cast<std::uint32_t>(count) | kOnDevice;
  words_[index + 1] = place.resource;
  words_[index + 2] = place.begin;
  return index;
}

std::uint32_t TriangleLists::addPacked(const oracle::Surface& surface, std::uint32_t list) {
  const TriangleList triangles = (*this)[list];
  BOCST_ASSERT(triangles.count > 0 && triangles.count <= PackedTriangles::kMostTriangles);
  std::array<std::uint32_t, PackedTriangles::kMostTriangles> ids;
  for (std::size_t i = 0; i < triangles.count; ++i) ids[i] = triangles.ids[i];
  PackedTriangles::Words packed;
  const std::size_t size = PackedTriangles::pack(surface, ids.data(), triangles.count, packed);
  const std::uint32_t index = words_.append(kPackedHeader + size);
  std::uint32_t* const words = &words_[index];
  words[0] = words_[list] | kPacked;
  words[1] = list + 1;
  std::copy_n(packed.begin(), size, words + kPackedHeader);
  return index;
}

std::uint32_t TriangleLists::addCopy(const TriangleLists& from, std::uint32_t list) {
  const auto copy = [this](const std::uint32_t* words, std::size_t count) {
    const std::uint32_t index = words_.append(count);
    std::copy_n(words, count, &words_[index]);
    return index;
  };
  const std::uint32_t* const words = &from.words_[list];
  const std::uint32_t flags = words[0];
  if ((flags & kOnDevice) != 0) return copy(words, kDeviceListWords);
  if ((flags & kPacked) == 0) return copy(words, 1 + idWords(flags));
  const std::uint32_t ids = copy(&from.words_[words[1]], idWords(flags)),
                      index = copy(words, kPackedHeader + packedAt(words).words());
  words_[index + 1] = ids;
  return index;
}

}  // namespace bocst::tree
