// SPDX-License-Identifier: BSD-3-Clause
#include "commands/validation.h"

#include <algorithm>
#include <iostream>
#include <numeric>
#include <stdexcept>

#include "cli/printable.h"

namespace bocst::program {
namespace {

struct Row {
  const char* key;   // in JSON
  const char* name;  // for people
};

constexpr std::array<Row, Validation::kKeys> kRows = {{
    {"poses", "poses"},
    {"reference_hits", "reference hits"},
    {"hits", "bocst hits"},
    {"false_negatives", "false negatives"},
    {"false_positives", "false positives"},
    {"order_differences", "argument order matters"},
    {"reference_order_differences", "argument order matters to FCL"},
    {"contact_differences", "sets of contacts differ"},
    {"lost_by_fcl", "contacts lost by FCL"},
    {"mismatches", "mismatches"},
}};

Json overestimateJson(const Overestimate& over, std::size_t depth) {
  return {{"depth", depth}, {"false_positives", over.count()}, {"largest", over.largest},
          {"at", over.at},  {"pose", over.pose.numbers},       {"bins", over.bins}};
}

/// Whatever the order of the keys: other tools may have rewritten a report.
bool sameSettings(const Json& a, const Json& b) { return nlohmann::json(a) == nlohmann::json(b); }

}  // namespace

Shard Shard::parse(const std::string& text) {
  const std::size_t slash = text.find('/');
  const auto number = [](const std::string& digits) -> std::size_t {
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos) return 0;
    return std::stoul(digits);
  };
  Shard shard;
  if (slash != std::string::npos) {
    shard.index = number(text.substr(0, slash));
    shard.of = number(text.substr(slash + 1));
  }
  if (slash == std::string::npos || shard.index < 1 || shard.index > shard.of) {
    throw std::invalid_argument(text + " is not i/n with 1 <= i <= n");
  }
  return shard;
}

std::size_t Overestimate::binOf(double relative) {
  std::size_t bin = 0;
  for (double edge = 1e-6; bin + 1 < kBins && relative >= edge; edge *= 10) ++bin;
  return bin;
}

std::string Overestimate::binName(std::size_t bin) {
  if (bin + 1 == kBins) return ">= 1";
  return bin + 2 == kBins ? "< 1" : "< 1e-" + std::to_string(6 - bin);
}

std::size_t Overestimate::count() const { return std::accumulate(bins.begin(), bins.end(), std::size_t{0}); }

void Overestimate::add(double relative, std::size_t number, const Pose& where) {
  ++bins[binOf(relative)];
  if (relative <= largest) return;
  largest = relative;
  at = number;
  pose = where;
}

void Overestimate::add(const Overestimate& other) {
  for (std::size_t i = 0; i < kBins; ++i) bins[i] += other.bins[i];
  // Of equals the first pose, as in one run.
  if (other.largest > largest || (other.largest == largest && other.at < at)) {
    largest = other.largest;
    at = other.at;
    pose = other.pose;
  }
}

void Validation::fail(std::size_t number, const Pose& pose, const std::string& what) {
  ++count[kMismatches];
  if (failures.size() < kFailuresKept) failures.push_back({number, pose, what});
}

Json Validation::json() const {
  Json report = settings;
  if (shard.of > 1) report["shard"] = {{"index", shard.index}, {"of", shard.of}};
  for (std::size_t i = 0; i < kKeys; ++i) report[kRows[i].key] = count[i];
  report["failures"] = Json::array();
  for (const Failure& failure : failures) {
    report["failures"].push_back({{"at", failure.at}, {"pose", failure.pose.numbers}, {"what", failure.what}});
  }
  if (!overestimates.empty()) {
    report["overestimate_bins"] = Json::array();
    for (std::size_t bin = 0; bin < Overestimate::kBins; ++bin) {
      report["overestimate_bins"].push_back(Overestimate::binName(bin));
    }
    report["overestimates"] = Json::array();
    for (std::size_t i = 0; i < overestimates.size(); ++i) {
      report["overestimates"].push_back(overestimateJson(overestimates[i], i + 1));
    }
  }
  return report;
}

Validation Validation::fromJson(const Json& json) {
  Validation result;
  try {
    Json rest = json;
    const auto take = [&rest](const std::string& key) {
      Json value = rest.at(key);
      rest.erase(key);
      return value;
    };
    if (rest.contains("shard")) {
      const Json shard = take("shard");
      result.shard = {shard.at("index").get<std::size_t>(), shard.at("of").get<std::size_t>()};
      if (result.shard.index < 1 || result.shard.index > result.shard.of)
        throw std::runtime_error("a shard out of range");
    }
    for (std::size_t i = 0; i < kKeys; ++i) {
      const Json count = take(kRows[i].key);
      if (!count.is_number_unsigned()) throw std::runtime_error(std::string(kRows[i].key) + " is no count");
      result.count[i] = count.get<std::size_t>();
    }
    for (const Json& failure : take("failures")) {
      result.failures.push_back({failure.at("at"), {failure.at("pose")}, failure.at("what")});
    }
    if (rest.contains("overestimates")) {
      take("overestimate_bins");
      for (const Json& over : take("overestimates")) {
        result.overestimates.push_back({over.at("bins"), over.at("largest"), over.at("at"), {over.at("pose")}});
      }
    }
    result.settings = rest;
    result.settings.at("seed");
  } catch (const Json::exception&) {
    throw std::runtime_error("not a report of `bocst validate`");
  }
  return result;
}

Validation Validation::merged(const std::vector<Validation>& parts) {
  Validation sum = parts.at(0);
  sum.shard = {};
  sum.count = {};
  sum.failures.clear();
  sum.overestimates.assign(sum.overestimates.size(), {});
  const std::size_t of = parts[0].shard.of;
  std::vector<bool> seen(of);
  for (const Validation& part : parts) {
    const std::string name = "shard " + std::to_string(part.shard.index) + "/" + std::to_string(part.shard.of);
    if (!sameSettings(part.settings, sum.settings) || part.shard.of != of ||
        part.overestimates.size() != sum.overestimates.size()) {
      throw std::runtime_error(name + " belongs to another run: meshes, options, seed and poses must be the same");
    }
    if (seen[part.shard.index - 1]) throw std::runtime_error(name + " is given twice");
    seen[part.shard.index - 1] = true;
    for (std::size_t i = 0; i < kKeys; ++i) sum.count[i] += part.count[i];
    sum.failures.insert(sum.failures.end(), part.failures.begin(), part.failures.end());
    for (std::size_t i = 0; i < sum.overestimates.size(); ++i) sum.overestimates[i].add(part.overestimates[i]);
  }
  const auto missing = std::find(seen.begin(), seen.end(), false);
  if (missing != seen.end()) {
    throw std::runtime_error("shard " + std::to_string(missing - seen.begin() + 1) + "/" + std::to_string(of) +
                             " is missing");
  }
  std::sort(sum.failures.begin(), sum.failures.end(), [](const Failure& a, const Failure& b) { return a.at < b.at; });
  if (sum.failures.size() > kFailuresKept) sum.failures.resize(kFailuresKept);
  return sum;
}

void Validation::print() const {
  Table table;
  if (shard.of > 1) table.row({"shard", std::to_string(shard.index) + "/" + std::to_string(shard.of)});
  for (std::size_t i = 0; i < kKeys; ++i) {
    if (i == kContactDifferences && settings.at("contacts_compared") == false) continue;
    if (i == kLostByFcl && settings.at("options").at("scalar") != "float") continue;
    table.row({kRows[i].name, std::to_string(count[i])});
  }
  table.print();
  if (!overestimates.empty()) {
    std::cout << "\nFalse positives by depth and by distance divided by the smaller mesh's radius:\n";
    Table histogram;
    std::vector<std::string> head = {"depth", "all"};
    for (std::size_t bin = 0; bin < Overestimate::kBins; ++bin) head.push_back(Overestimate::binName(bin));
    head.push_back("largest");
    histogram.row(head);
    for (std::size_t i = 0; i < overestimates.size(); ++i) {
      const Overestimate& over = overestimates[i];
      std::vector<std::string> row = {std::to_string(i + 1), std::to_string(over.count())};
      for (const std::size_t n : over.bins) row.push_back(std::to_string(n));
      row.push_back(formatNumber(over.largest));
      histogram.row(row);
    }
    histogram.print();
    const Overestimate& last = overestimates.back();
    if (last.count() > 0)
      std::cout << "largest at depth " << overestimates.size() << ": --pose " << last.pose.text() << '\n';
  }
  for (const Failure& failure : failures)
    std::cout << printable(failure.what) << ": --pose " << failure.pose.text() << '\n';
}

void Validation::throwIfWrong() const {
  if (count[kMismatches] == 0) return;
  const std::string beyond = settings.value(kBeyondLimits, "");
  std::string text = std::to_string(count[kMismatches]) + " of " + std::to_string(count[kPoses]) + " poses answered " +
                     (beyond.empty() ? "wrongly" : "differently from FCL");
  if (!failures.empty()) {
    text += ", the first (" + failures.front().what + ") at --pose " + failures.front().pose.text();
  }
  if (!beyond.empty()) text += "; " + beyond;
  throw std::runtime_error(text);
}

}  // namespace bocst::program
