// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "oracle/gl/compute_oracle.h"

namespace bocst::oracle::gl {

/// Trees of two surfaces at some poses, and what a walk has to find, for tests of devices: every leaf of one is
/// compared with every leaf of the other in double.
class KnownPairs {
 public:
  KnownPairs(const Surface& a, const Surface& b);

  /// Walks them on the device. Says what was wrong first; empty when all is right. Left out, as a device may leave them
  /// to the host: pairs that it did not decide.
  std::string ask(ComputeOracle& oracle) const;

 private:
  struct Tree {
    std::vector<std::uint32_t> words;
    DeviceWalks::Tree tree;
    std::vector<std::array<double, 4>> leaves;  // spheres about the middle of the root
  };
  enum class Known : std::uint8_t { kApart, kMeet, kClose };

  static constexpr int kDepth = 4;

  static Tree treeOf(const Surface& surface, int levels);
  static bool isFrontier(const Tree& t, std::uint32_t block, std::uint32_t octant);
  void addPose(int number, std::uint32_t a, std::uint32_t b, double unit);

  std::vector<Tree> trees_;
  std::vector<DeviceWalks::Pair> pairs_;
  std::vector<Known> known_;
};

}  // namespace bocst::oracle::gl
