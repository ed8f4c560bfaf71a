// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <unordered_map>
#include <vector>

#include "memory/pool.h"
#include "tree/packed_triangles.h"

namespace bocst::oracle {
class DeviceResource;
}

namespace bocst::tree {

/// The numbers of a list's triangles, where the tree keeps them.
class TriangleIds {
 public:
  TriangleIds() = default;
  TriangleIds(const std::uint32_t* words, bool narrow) : words_(words), narrow_(narrow) {}

  std::uint32_t operator[](std::size_t i) const {
    if (!narrow_) return words_[i];
    std::uint16_t step;
    std::memcpy(&step, reinterpret_cast<const char*>(words_ + 1) + i * sizeof(step), sizeof(step));
    return words_[0] + step;
  }

  bool areKnown() const { return words_ != nullptr; }
  /// Those of a leaf are about to be read.
  void prefetch() const {
    constexpr std::size_t kLine = 16;  // words
    __builtin_prefetch(words_);
    __builtin_prefetch(words_ + kLine);
  }

 private:
  const std::uint32_t* words_ = nullptr;
  bool narrow_ = false;  // the least number, then 16-bit steps from it
};

/// Triangles of a node with a list; ids are not known where only the oracle has them, never for a leaf.
struct TriangleList {
  TriangleIds ids;
  std::uint32_t count = 0;

  void appendTo(std::vector<std::uint32_t>& ids) const;
};

/// The lists of a tree's nodes. A list never moves or changes, so that readers need no lock while one writer appends.
/// Threads: as Pool; where lists are on a device, the writer alone asks for their places.
class TriangleLists {
 public:
  /// Where an oracle keeps a list.
  struct Place {
    std::shared_ptr<const oracle::DeviceResource> resource;
    std::uint32_t begin;
  };

  // What is there.

  TriangleList operator[](std::uint32_t list) const {
    const std::uint32_t* const words = &words_[list];
    const std::uint32_t flags = words[0], count = flags & kCount;
    if ((flags & kOnDevice) != 0) return {{}, count};
    const bool narrow = (flags & kNarrow) != 0;
    return {{words + 1, narrow}, count};
  }
  /// False where nobody has packed it.
  bool packed(std::uint32_t list, PackedTriangles& triangles) const {
    const std::uint32_t* const words = &words_[list];
    if ((words[0] & kPacked) == 0) return false;
    triangles = packedAt(words);
    return true;
  }
  bool isPacked(std::uint32_t list) const { return (words_[list] & kPacked) != 0; }
  /// True if the oracle keeps the list.
  bool isOnDevice(std::uint32_t list) const { return (words_[list] & kOnDevice) != 0; }
  Place place(std::uint32_t list) const { return {resources_[words_[list + 1]], words_[list + 2]}; }
  /// Where it lies, for those who want it in the processor's cache.
  const std::uint32_t* begin(std::uint32_t list) const { return &words_[list]; }

  // What is new; each returns the list's index. They throw std::length_error beyond 2^29 triangles or 2^30 words.

  std::uint32_t add(const std::uint32_t* ids, std::size_t count);
  std::uint32_t addDeviceList(std::size_t count, const Place& place);
  /// A list with its corners, as PackedTriangles::pack() put them into `words`.
  std::uint32_t addPacked(const std::uint32_t* ids, std::size_t count, const PackedTriangles::Words& packed,
                          std::size_t size);
  std::uint32_t addCopy(const TriangleLists& from, std::uint32_t list);
  std::uint32_t addWithoutCorners(const TriangleLists& from, std::uint32_t list);

  bool isHalfFull() const { return words_.size() > Words::kMost / 2; }
  std::size_t bytes() const { return words_.bytes(); }
  /// Of what oracles keep for the lists.
  std::size_t deviceBytes() const { return device_bytes_; }
  void clear() { TriangleLists().swap(*this); }
  void swap(TriangleLists& other);

 private:
  using Words = memory::Pool<std::uint32_t, 8>;

  // A list is flags and a length, then the numbers: all as they are or, narrow, the least and 16-bit steps from it;
  // packed, then PackedTriangles. On a device: flags and length, the number of a resource, a place there.
  static constexpr std::uint32_t kOnDevice = 0x80000000u, kPacked = 0x40000000u, kNarrow = 0x20000000u,
                                 kCount = 0x1fffffffu;
  static constexpr std::size_t kDeviceListWords = 3;

  static std::size_t idWords(std::uint32_t flags) {
    const std::size_t count = flags & kCount;
    return (flags & kNarrow) != 0 ? 1 + (count + 1) / 2 : count;
  }
  static std::uint32_t flagsOf(const std::uint32_t* ids, std::size_t count);
  static void writeIds(const std::uint32_t* ids, std::size_t count, bool narrow, std::uint32_t* to);
  static PackedTriangles packedAt(const std::uint32_t* list) { return {list + 1 + idWords(list[0]), list[0] & kCount}; }

  std::uint32_t numberOf(const std::shared_ptr<const oracle::DeviceResource>& resource);

  Words words_;
  std::vector<std::shared_ptr<const oracle::DeviceResource>> resources_;
  std::unordered_map<const oracle::DeviceResource*, std::uint32_t> numbers_;  // of resources_
  std::size_t device_bytes_ = 0;
};

}  // namespace bocst::tree
