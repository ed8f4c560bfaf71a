// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cli/report.h"

namespace bocst::program {

/// One figure of a benchmark.
struct BenchRow {
  enum class Unit { kMicroseconds, kBytesPerTriangle, kQueriesPerSecond, kTimes, kFrames };

  std::string scenario;
  std::string key;   ///< For programs: unique in a report.
  std::string name;  ///< For people.
  Unit unit = Unit::kMicroseconds;
  std::optional<double> bocst;
  std::optional<double> fcl;
  std::optional<double> ratio;  ///< Above 1 is better.
};

/// What `bench` says in the end: rows by scenario, and whether both sides answered alike.
class BenchReport {
 public:
  using Unit = BenchRow::Unit;

  /// The rows that follow are this scenario's.
  void begin(const std::string& scenario) { scenario_ = scenario; }

  /// Both sides' figures of one thing; the ratio says how many times better bocst's is.
  void compare(const std::string& key, const std::string& name, Unit unit, double bocst, double fcl);

  /// Median, mean and 95th percentile of both sides' microseconds.
  void compareTimes(const std::string& key, const std::string& name, const std::vector<double>& bocst,
                    const std::vector<double>& fcl);

  /// A figure that stands alone, or whose ratio is to something else.
  void figure(const std::string& key, const std::string& name, Unit unit, std::optional<double> bocst,
              std::optional<double> fcl = {}, std::optional<double> ratio = {});

  /// Why there is no figure.
  void skip(const std::string& key, const std::string& reason);

  /// A line for people, below the table.
  void note(const std::string& line) { notes_.push_back(line); }

  /// A member of the JSON report beside the rows.
  void set(const std::string& key, Json value) { members_[key] = std::move(value); }

  /// Verdicts of both sides in the same order, and where they were asked for, if messages shall name that.
  void verdicts(const std::vector<bool>& bocst, const std::vector<bool>& fcl,
                const std::vector<Eigen::Isometry3d>& X_ABs = {});

  /// Other answers that must be equal. @param example of a difference, for the message.
  void mustBeEqual(bool equal, const std::string& what, const std::string& example = "");

  Json json(Json head) const;
  std::string csv() const;
  void print() const;

  /// @throws std::runtime_error when answers differ.
  void check() const;

 private:
  /// FNV-1a over verdicts in order.
  class Hash {
   public:
    void add(const std::vector<bool>& verdicts);
    std::string text() const;

   private:
    std::uint64_t state_ = 0xcbf29ce484222325u;
  };

  struct Skip {
    std::string scenario, key, reason;
  };

  const BenchRow* rowOf(const std::string& key) const;
  Json ratios() const;

  std::string scenario_;
  std::vector<BenchRow> rows_;
  std::vector<Skip> skipped_;
  std::vector<std::string> notes_;
  std::vector<std::string> differences_;
  std::size_t verdict_count_ = 0;
  Hash bocst_hash_, fcl_hash_;
  Json members_ = Json::object();
};

}  // namespace bocst::program
