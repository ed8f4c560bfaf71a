// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <cstring>
#include <unordered_map>
#include <vector>

namespace bocst::io {

/// Vertices by position, for formats that give every corner of a triangle a vertex of its own.
class VertexPool {
 public:
  explicit VertexPool(std::vector<Eigen::Vector3d>& vertices) : vertices_(vertices) {}

  std::uint32_t indexOf(const Eigen::Vector3d& p) {
    Key key;
    const Eigen::Vector3d q = p.array() + 0.0;  // -0 and 0 are the same place
    std::memcpy(key.data(), q.data(), sizeof(key));
    const auto [entry, is_new] = index_.emplace(key, static_cast<std::uint32_t>(vertices_.size()));
    if (is_new) vertices_.push_back(p);
    return entry->second;
  }

 private:
  using Key = std::array<std::uint64_t, 3>;
  struct Hash {
    std::size_t operator()(const Key& key) const {
      std::uint64_t h = 0;
      for (const std::uint64_t k : key) {
        h = (h ^ k) * 0x9e3779b97f4a7c15u;
        h ^= h >> 29;
      }
      return h;
    }
  };

  std::vector<Eigen::Vector3d>& vertices_;
  std::unordered_map<Key, std::uint32_t, Hash> index_;
};

}  // namespace bocst::io
