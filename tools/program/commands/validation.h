// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "cli/report.h"
#include "pairs/poses.h"

namespace bocst::program {

/// A part of a run: number `index` of `of`, from 1 on. The whole run is 1 of 1.
struct Shard {
  std::size_t index = 1;
  std::size_t of = 1;

  /// @throws std::invalid_argument when the text is not i/n with 1 <= i <= n.
  static Shard parse(const std::string& text);

  bool has(std::size_t ray) const { return ray % of == index - 1; }
};

/// How far apart meshes were that conservative answers of one depth said touch.
struct Overestimate {
  /// Distance over the smaller mesh's radius: below 1e-6, then a decade each, then 1 and above.
  static constexpr std::size_t kBins = 8;
  static std::size_t binOf(double relative);
  static std::string binName(std::size_t bin);

  std::array<std::size_t, kBins> bins{};
  double largest = 0;
  std::size_t at = 0;  ///< The number of that pose.
  Pose pose;

  std::size_t count() const;
  void add(double relative, std::size_t number, const Pose& where);
  void add(const Overestimate& other);
};

/// What `bocst validate` found. Parts of a run add up to what one run would have found.
struct Validation {
  /// A pose with a wrong answer, and what was wrong.
  struct Failure {
    std::size_t at = 0;  ///< The number of the pose.
    Pose pose;
    std::string what;
  };
  static constexpr std::size_t kFailuresKept = 16;  ///< The first ones.

  /// The counts by their keys in JSON, in the order of reading.
  enum Key {
    kPoses,
    kReferenceHits,
    kHits,
    kFalseNegatives,
    kFalsePositives,
    kOrderDifferences,
    kReferenceOrderDifferences,
    kContactDifferences,
    kLostByFcl,
    kMismatches,
    kKeys
  };

  static constexpr const char* kBeyondLimits = "beyond_limits";  ///< Of the settings: beyondLimits(), if not empty.

  Json settings;  ///< What must be the same in all parts.
  Shard shard;
  std::array<std::size_t, kKeys> count{};
  std::vector<Failure> failures;
  std::vector<Overestimate> overestimates;  ///< [0] is depth 1; empty where they were not asked for.

  void fail(std::size_t number, const Pose& pose, const std::string& what);

  Json json() const;

  /// @throws std::runtime_error when this is no such report.
  static Validation fromJson(const Json& json);

  /// @throws std::runtime_error when parts are missing, twice, or not of one run.
  static Validation merged(const std::vector<Validation>& parts);

  /// A table for people.
  void print() const;

  /// @throws std::runtime_error that names the first mismatch, if there is one.
  void throwIfWrong() const;
};

}  // namespace bocst::program
