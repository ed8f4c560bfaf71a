// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <mutex>

namespace bocst::oracle {

/// How long batches take somewhere, in seconds.
struct CostModel {
  double batch, cell, triangle;

  double of(double cells, double triangles) const { return batch + cell * cells + triangle * triangles; }

  /// A batch took so long there. Each term is corrected by its share of what was expected.
  void learn(double cells, double triangles, double seconds);
};

/// When a device that is expected to be slower than the host is tried again: devices that were busy get better.
class Trials {
 public:
  /// The device must take less than this share of the host's time: a smaller gain is within the models' error.
  static constexpr double kWorthwhile = 0.95;

  /// Work came that takes the host `host` seconds.
  void earn(double host);
  /// True if work that takes so long on the device and on the host may be tried. Without paying.
  bool affords(double device, double host) const;
  /// Pays for a trial, or says no.
  bool take(double device, double host);

 private:
  double credit_ = 0;  // seconds
};

/// Chooses who walks pairs of sphere-trees: a device or the host. Learns from what both took.
///
/// Threads: any number. While one thread uses this, the others let the host walk.
class PairsChoice {
 public:
  /// is_hardware: true if the device is expected to be fast, before it was measured.
  explicit PairsChoice(bool is_hardware);

  bool takesDevice(std::size_t pairs);
  void learn(std::size_t pairs, double seconds, bool by_host);

 private:
  std::mutex mutex_;  // a child after fork() may find it locked for ever, so nobody waits for it
  CostModel host_, device_;
  Trials trials_;
};

}  // namespace bocst::oracle
