// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/weld.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

namespace bocst {

std::vector<std::uint32_t> weld(const std::vector<Eigen::Vector3d>& vertices) {
  constexpr std::uint32_t kEmpty = 0xffffffffu;
  std::size_t size = 16;
  while (size < 2 * vertices.size()) size *= 2;
  std::vector<std::uint32_t> slots(size, kEmpty), first(vertices.size());
  for (std::uint32_t i = 0; i < vertices.size(); ++i) {
    std::uint64_t hash = 0;
    for (int k = 0; k < 3; ++k) {
      const double x = vertices[i][k] + 0.0;  // -0.0 is 0.0
      std::uint64_t bits;
      std::memcpy(&bits, &x, sizeof bits);
      hash = mixed(hash ^ bits, 0x9e3779b97f4a7c15ull);
    }
    std::size_t at = hash & (size - 1);
    while (slots[at] != kEmpty && vertices[slots[at]] != vertices[i]) at = (at + 1) & (size - 1);
    if (slots[at] == kEmpty) slots[at] = i;
    first[i] = slots[at];
  }
  return first;
}

std::vector<std::uint32_t> componentOfEachVertex(std::vector<std::uint32_t> welded,
                                                 const std::vector<Mesh::Indices>& triangles) {
  std::vector<std::uint32_t>& parent = welded;
  const auto root = [&parent](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const Mesh::Indices& t : triangles) {
    if (parent[t[0]] == parent[t[1]] && parent[t[1]] == parent[t[2]]) continue;
    for (std::size_t k = 1; k < 3; ++k) {
      const std::uint32_t a = root(t[0]), b = root(t[k]);
      parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::uint32_t i = 0; i < parent.size(); ++i) parent[i] = root(i);
  return welded;
}

}  // namespace bocst
