// SPDX-License-Identifier: BSD-3-Clause
#include "bench/bench_report.h"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <stdexcept>
#include <utility>

#include "pairs/poses.h"

namespace bocst::program {
namespace {

using Unit = BenchRow::Unit;

/// What JSON reports have always had under "ratio".
constexpr const char* kRatios[] = {"first_answer", "query_median",    "query_mean",    "query_p95",
                                   "memory",       "distance_median", "first_distance"};

const char* nameOf(Unit unit) {
  switch (unit) {
    case Unit::kMicroseconds:
      return "us";
    case Unit::kBytesPerTriangle:
      return "bytes/triangle";
    case Unit::kQueriesPerSecond:
      return "queries/s";
    case Unit::kTimes:
      return "x";
    case Unit::kFrames:
      return "frames";
  }
  return "";
}

std::string formatted(std::optional<double> value, Unit unit) {
  if (!value) return "-";
  switch (unit) {
    case Unit::kMicroseconds:
      return formatTime(*value);
    case Unit::kBytesPerTriangle:
      return formatNumber(*value) + " B";
    case Unit::kQueriesPerSecond:
      return formatNumber(*value) + " /s";
    case Unit::kTimes:
      return formatNumber(*value);
    case Unit::kFrames:
      return formatPlain(*value);
  }
  return "";
}

Json orNull(std::optional<double> value) { return value ? Json(*value) : Json(nullptr); }

std::string csvNumber(std::optional<double> value) { return value ? formatPlain(*value) : ""; }

}  // namespace

void BenchReport::Hash::add(const std::vector<bool>& verdicts) {
  for (const bool verdict : verdicts) state_ = (state_ ^ (verdict ? 1u : 0u)) * 0x100000001b3u;
}

std::string BenchReport::Hash::text() const {
  char text[17];
  std::snprintf(text, sizeof(text), "%016llx", static_cast<unsigned long long>(state_));
  return text;
}

void BenchReport::compare(const std::string& key, const std::string& name, Unit unit, double bocst, double fcl) {
  const bool more_is_better = unit == Unit::kQueriesPerSecond || unit == Unit::kTimes;
  figure(key, name, unit, bocst, fcl, more_is_better ? bocst / fcl : fcl / bocst);
}

void BenchReport::compareTimes(const std::string& key, const std::string& name, const std::vector<double>& bocst,
                               const std::vector<double>& fcl) {
  const auto row = [&](const char* end, const char* which, double ours, double theirs) {
    compare(key + end, name + which, Unit::kMicroseconds, ours, theirs);
  };
  row("_median", ", median", quantile(bocst, 0.5), quantile(fcl, 0.5));
  row("_mean", ", mean", mean(bocst), mean(fcl));
  row("_p95", ", 95th percentile", quantile(bocst, 0.95), quantile(fcl, 0.95));
}

void BenchReport::figure(const std::string& key, const std::string& name, Unit unit, std::optional<double> bocst,
                         std::optional<double> fcl, std::optional<double> ratio) {
  rows_.push_back({scenario_, key, name, unit, bocst, fcl, ratio});
}

void BenchReport::skip(const std::string& key, const std::string& reason) {
  skipped_.push_back({scenario_, key, reason});
}

void BenchReport::verdicts(const std::vector<bool>& bocst, const std::vector<bool>& fcl,
                           const std::vector<Eigen::Isometry3d>& X_ABs) {
  bocst_hash_.add(bocst);
  fcl_hash_.add(fcl);
  verdict_count_ += fcl.size();
  std::string example;
  const auto [ours, theirs] = std::mismatch(bocst.begin(), bocst.end(), fcl.begin());
  if (ours != bocst.end() && !X_ABs.empty()) {
    example = std::string(" (only ") + (*ours ? "bocst" : "FCL") + " finds a contact at --pose " +
              Pose::fromTransform(X_ABs[static_cast<std::size_t>(ours - bocst.begin())]).text() + ")";
  }
  mustBeEqual(bocst == fcl, "verdicts", example);
}

void BenchReport::mustBeEqual(bool equal, const std::string& what, const std::string& example) {
  if (!equal) differences_.push_back(what + " of " + scenario_ + example);
}

const BenchRow* BenchReport::rowOf(const std::string& key) const {
  for (const BenchRow& row : rows_) {
    if (row.key == key) return &row;
  }
  return nullptr;
}

Json BenchReport::ratios() const {
  Json ratios;
  for (const char* key : kRatios) {
    const BenchRow* row = rowOf(key);
    ratios[key] = row != nullptr ? orNull(row->ratio) : Json(nullptr);
  }
  return ratios;
}

Json BenchReport::json(Json head) const {
  head.update(members_);
  head["ratio"] = ratios();
  Json microseconds = Json::object();
  Json rows = Json::array();
  for (const BenchRow& row : rows_) {
    if (row.unit == Unit::kMicroseconds && row.fcl) {
      microseconds[row.key] = {{"bocst", orNull(row.bocst)}, {"fcl", orNull(row.fcl)}};
    }
    rows.push_back({{"scenario", row.scenario},
                    {"row", row.key},
                    {"unit", nameOf(row.unit)},
                    {"bocst", orNull(row.bocst)},
                    {"fcl", orNull(row.fcl)},
                    {"ratio", orNull(row.ratio)}});
  }
  Json skipped = Json::array();
  for (const Skip& skip : skipped_) {
    skipped.push_back({{"scenario", skip.scenario}, {"row", skip.key}, {"reason", skip.reason}});
  }
  head["microseconds"] = std::move(microseconds);
  head["verdicts"] = {{"bocst", bocst_hash_.text()}, {"fcl", fcl_hash_.text()}, {"equal", differences_.empty()}};
  head["rows"] = std::move(rows);
  head["skipped"] = std::move(skipped);
  return head;
}

std::string BenchReport::csv() const {
  std::string text = "scenario,row,unit,bocst,fcl,ratio\n";
  for (const BenchRow& row : rows_) {
    text += row.scenario + ',' + row.key + ',' + nameOf(row.unit) + ',' + csvNumber(row.bocst) + ',' +
            csvNumber(row.fcl) + ',' + csvNumber(row.ratio) + '\n';
  }
  return text;
}

void BenchReport::print() const {
  Table table;
  table.row({"", "bocst", "FCL OBBRSS", "ratio"});
  std::string scenario;
  for (const BenchRow& row : rows_) {
    if (std::exchange(scenario, row.scenario) != row.scenario) table.row({row.scenario});
    table.row({"  " + row.name, formatted(row.bocst, row.unit), formatted(row.fcl, row.unit),
               row.ratio ? formatRatio(*row.ratio) : "-"});
  }
  table.print();
  std::cout << '\n';
  for (const Skip& skip : skipped_) std::cout << skip.scenario << ": no " << skip.key << ": " << skip.reason << '\n';
  for (const std::string& line : notes_) std::cout << line << '\n';
  if (verdict_count_ > 0) {
    std::cout << verdict_count_ << " answers compared with FCL: " << (differences_.empty() ? "equal" : "DIFFERENT")
              << ", hash " << bocst_hash_.text() << '\n';
  }
}

void BenchReport::check() const {
  std::string all;
  for (const std::string& what : differences_) all += (all.empty() ? "" : ", ") + what;
  if (!all.empty()) throw std::runtime_error("the answers differ from FCL's: " + all);
}

}  // namespace bocst::program
