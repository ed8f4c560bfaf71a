// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cost_model.h"

#include <algorithm>
#include <cmath>

namespace bocst::oracle {
namespace {

constexpr double kRate = 0.3;   // the share of an error, as a logarithm, that one batch corrects
constexpr double kMostOff = 8;  // a batch counts as off by at most this factor: its thread may have waited for its core

constexpr double kTrying = 0.02;      // the share of the host's time that trials of a slower device may take
constexpr double kMostCredit = 0.02;  // seconds of it that may be saved up
constexpr double kSlowestTry = 4;     // a trial may take at most this multiple of the host's time
constexpr double kLeastPrice = 0.25;  // and counts as at least this share of it

// Before anything is measured; a cell is a pair here. The host: bunny00 at depth 7 on one core. A GPU: a guess. A
// software renderer takes some hundred times as long as the host.
constexpr CostModel kHostPairs{1e-7, 5e-6, 0}, kGpuPairs{3e-4, 1e-6, 0}, kSoftwarePairs{1e-3, 3e-4, 0};

}  // namespace

void CostModel::learn(double cells, double triangles, double seconds) {
  const double expected = of(cells, triangles);
  if (!(expected > 0)) return;
  const double off = kRate * std::log(std::clamp(seconds / expected, 1 / kMostOff, kMostOff));
  batch *= std::exp(off * batch / expected);
  cell *= std::exp(off * cell * cells / expected);
  triangle *= std::exp(off * triangle * triangles / expected);
}

void Trials::earn(double host) { credit_ = std::min(kMostCredit, credit_ + kTrying * host); }

bool Trials::affords(double device, double host) const {
  return device <= host + std::min(credit_, (kSlowestTry - 1) * host);
}

bool Trials::take(double device, double host) {
  const double price = std::max(device - host, kLeastPrice * host);
  if (price >= credit_ || device >= kSlowestTry * host) return false;
  credit_ -= price;
  return true;
}

PairsChoice::PairsChoice(bool is_hardware) : host_(kHostPairs), device_(is_hardware ? kGpuPairs : kSoftwarePairs) {}

bool PairsChoice::takesDevice(std::size_t pairs) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (!lock.owns_lock()) return false;
  const auto count = static_cast<double>(pairs);
  const double here = host_.of(count, 0), there = device_.of(count, 0);
  trials_.earn(here);
  return there < Trials::kWorthwhile * here || trials_.take(there, here);
}

void PairsChoice::learn(std::size_t pairs, double seconds, bool by_host) {
  const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
  if (lock.owns_lock()) (by_host ? host_ : device_).learn(static_cast<double>(pairs), 0, seconds);
}

}  // namespace bocst::oracle
