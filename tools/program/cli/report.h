// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <chrono>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace bocst::program {

/// Insertion order is reading order.
using Json = nlohmann::ordered_json;

/// [x, y, z].
inline Json list(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Where a report goes: a table on stdout, or JSON into a file or ("-") stdout.
class Output {
 public:
  std::string json_file;

  bool wantsJson() const { return !json_file.empty(); }

  /// As checkOutputs(), with `others` written beside this.
  void check(const std::vector<std::string>& inputs = {}, std::vector<std::string> others = {}) const;

  /// As writeText().
  void write(const Json& json) const;
};

/// As writeFile(), or to stdout for "-". @throws std::runtime_error when that fails; main() looks after stdout.
void writeText(const std::string& file, const std::string& text);

/// A table for people: the first column to the left, the others to the right, where figures belong.
class Table {
 public:
  enum class Others { kRight, kLeft };
  explicit Table(Others others = Others::kRight) : others_(others) {}

  void row(std::vector<std::string> cells);  ///< Made printable.
  void print() const;

 private:
  Others others_;
  std::vector<std::vector<std::string>> rows_;
};

/// A line on stderr that counts up while long work runs, after a while with an estimate of the time left; nothing when
/// stderr is no terminal.
class Progress {
 public:
  Progress(std::string what, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step();

 private:
  std::string what_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool terminal_;
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point next_;
};

/// Microseconds since it was made.
class Stopwatch {
 public:
  double microseconds() const {
    return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// ", about 40 s left" once enough is done to tell, else empty.
std::string timeLeft(std::size_t done, std::size_t total, double seconds_so_far);

/// The value below which the fraction q of the samples lies; 0.5 is the median. Takes a copy to sort.
double quantile(std::vector<double> samples, double q);
double mean(const std::vector<double>& samples);

std::string formatTime(double microseconds);
std::string formatBytes(double bytes);
std::string formatNumber(double value, int digits = 3);  ///< That many significant digits, no exponent if short.
std::string formatVector(const Eigen::Vector3d& v, int digits, const char* between);
std::string formatPlain(double value);  ///< "514", "0.05": up to twelve digits, no zeros after them.
std::string formatExact(double value);  ///< The fewest digits that give this double again.
std::string formatRatio(double ratio);  ///< "12.3 x"; "-" beside nothing.

}  // namespace bocst::program
