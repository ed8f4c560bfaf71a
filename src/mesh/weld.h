// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace bocst {

/// A hash value of two numbers: their product of 128 bits, folded.
inline std::uint64_t mixed(std::uint64_t a, std::uint64_t b) {
  __extension__ using Product = unsigned __int128;
  const Product p = Product{a} * b;
  return static_cast<std::uint64_t>(p) ^ static_cast<std::uint64_t>(p >> 64);
}

/// For each vertex the first one at the same place.
std::vector<std::uint32_t> weld(const std::vector<Eigen::Vector3d>& vertices);

/// For each vertex the first vertex of its connected component; `welded` is what weld() returned.
std::vector<std::uint32_t> componentOfEachVertex(std::vector<std::uint32_t> welded,
                                                 const std::vector<Mesh::Indices>& triangles);

inline bool isTriangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) { return a != b && b != c && c != a; }

}  // namespace bocst
