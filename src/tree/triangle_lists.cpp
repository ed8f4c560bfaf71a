// SPDX-License-Identifier: BSD-3-Clause
#include "tree/triangle_lists.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "oracle/oracle.h"

namespace bocst::tree {

void TriangleList::appendTo(std::vector<std::uint32_t>& all) const {
  for (std::size_t i = 0; i < count; ++i) all.push_back(ids[i]);
}

std::uint32_t TriangleLists::flagsOf(const std::uint32_t* ids, std::size_t count) {
  if (count > kCount) throw std::length_error("bocst: a node of more than 2^29 triangles");
  const auto length = static_cast<std::uint32_t>(count);
  if (count < 2) return length;
  const auto [least, most] = std::minmax_element(ids, ids + count);
  return *most - *least <= 0xffff ? length | kNarrow : length;
}

void TriangleLists::writeIds(const std::uint32_t* ids, std::size_t count, bool narrow, std::uint32_t* to) {
  if (!narrow) {
    std::copy_n(ids, count, to);
    return;
  }
  const std::uint32_t least = *std::min_element(ids, ids + count);
  to[0] = least;
  auto* const steps = reinterpret_cast<char*>(to + 1);
  for (std::size_t i = 0; i < count; ++i) {
    const auto step = static_cast<std::uint16_t>(ids[i] - least);
    std::memcpy(steps + i * sizeof(step), &step, sizeof(step));
  }
}

std::uint32_t TriangleLists::add(const std::uint32_t* ids, std::size_t count) {
  const std::uint32_t flags = flagsOf(ids, count), index = words_.append(1 + idWords(flags));
  words_[index] = flags;
  writeIds(ids, count, (flags & kNarrow) != 0, &words_[index] + 1);
  return index;
}

std::uint32_t TriangleLists::addPacked(const std::uint32_t* ids, std::size_t count,
                                       const PackedTriangles::Words& packed, std::size_t size) {
  const std::uint32_t flags = flagsOf(ids, count), index = words_.append(1 + idWords(flags) + size);
  std::uint32_t* const words = &words_[index];
  words[0] = flags | kPacked;
  writeIds(ids, count, (flags & kNarrow) != 0, words + 1);
  std::copy_n(packed.begin(), size, words + 1 + idWords(flags));
  return index;
}

std::uint32_t TriangleLists::numberOf(const std::shared_ptr<const oracle::DeviceResource>& resource) {
  const auto known = numbers_.find(resource.get());
  if (known != numbers_.end()) return known->second;
  const auto number = static_cast<std::uint32_t>(resources_.size());
  resources_.push_back(resource);
  numbers_.emplace(resource.get(), number);
  device_bytes_ += resource->bytes();
  return number;
}

std::uint32_t TriangleLists::addDeviceList(std::size_t count, const Place& place) {
  if (count > kCount) throw std::length_error("bocst: a node of more than 2^29 triangles");
  const std::uint32_t resource = numberOf(place.resource), index = words_.append(kDeviceListWords);
  words_[index] = static_cast<std::uint32_t>(count) | kOnDevice;
  words_[index + 1] = resource;
  words_[index + 2] = place.begin;
  return index;
}

std::uint32_t TriangleLists::addCopy(const TriangleLists& from, std::uint32_t list) {
  const std::uint32_t* const words = &from.words_[list];
  const std::uint32_t flags = words[0];
  if ((flags & kOnDevice) != 0) return addDeviceList(flags & kCount, from.place(list));
  const std::size_t packed = (flags & kPacked) != 0 ? packedAt(words).words() : 0;
  const std::size_t count = 1 + packed + idWords(flags);
  const std::uint32_t index = words_.append(count);
  std::copy_n(words, count, &words_[index]);
  return index;
}

std::uint32_t TriangleLists::addWithoutCorners(const TriangleLists& from, std::uint32_t list) {
  const std::uint32_t* const words = &from.words_[list];
  const std::uint32_t flags = words[0] & ~kPacked;
  const std::uint32_t index = words_.append(1 + idWords(flags));
  words_[index] = flags;
  std::copy_n(words + 1, idWords(flags), &words_[index] + 1);
  return index;
}

void TriangleLists::swap(TriangleLists& other) {
  words_.swap(other.words_);
  resources_.swap(other.resources_);
  numbers_.swap(other.numbers_);
  std::swap(device_bytes_, other.device_bytes_);
}

}  // namespace bocst::tree
