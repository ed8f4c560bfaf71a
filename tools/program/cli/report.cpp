// SPDX-License-Identifier: BSD-3-Clause
#include "cli/report.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <numeric>
#include <utility>

#include "cli/file.h"
#include "cli/printable.h"

namespace bocst::program {

void Output::check(const std::vector<std::string>& inputs, std::vector<std::string> others) const {
  others.push_back(json_file);
  checkOutputs(others, inputs);
}

void Output::write(const Json& json) const {
  writeText(json_file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

void writeText(const std::string& file, const std::string& text) {
  if (file != "-") return writeFile(file, text);
  std::cout << text << std::flush;
}

void Table::row(std::vector<std::string> cells) {
  for (std::string& cell : cells) cell = printable(cell);
  rows_.push_back(std::move(cells));
}

void Table::print() const {
  std::vector<std::size_t> width;
  for (const auto& cells : rows_) {
    width.resize(std::max(width.size(), cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) width[i] = std::max(width[i], characters(cells[i]));
  }
  for (const auto& cells : rows_) {
    std::string line;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string pad(width[i] - characters(cells[i]), ' ');
      line += (i == 0 ? "" : "  ") + (i == 0 || others_ == Others::kLeft ? cells[i] + pad : pad + cells[i]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    std::cout << line << '\n';
  }
  std::cout << std::flush;
}

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)),
      total_(total),
      terminal_(::isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      next_(start_ + std::chrono::milliseconds(300)) {}

Progress::~Progress() {
  if (terminal_) std::fprintf(stderr, "\r\033[K");
}

void Progress::step() {
  ++done_;
  if (!terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  const double seconds = std::chrono::duration<double>(now - start_).count();
  std::fprintf(stderr, "\r%s %zu of %zu%s\033[K", what_.c_str(), done_, total_,
               timeLeft(done_, total_, seconds).c_str());
  std::fflush(stderr);
}

std::string timeLeft(std::size_t done, std::size_t total, double seconds_so_far) {
  if (done == 0 || done >= total || seconds_so_far < 2) return "";
  const double left = seconds_so_far * static_cast<double>(total - done) / static_cast<double>(done);
  if (left < 90) return ", about " + std::to_string(std::lround(left)) + " s left";
  if (left < 5400) return ", about " + std::to_string(std::lround(left / 60)) + " min left";
  return ", about " + std::to_string(std::lround(left / 3600)) + " h left";
}

double quantile(std::vector<double> samples, double q) {
  if (samples.empty()) return 0;
  std::sort(samples.begin(), samples.end());
  const double at = q * static_cast<double>(samples.size() - 1);
  const auto below = static_cast<std::size_t>(at);
  const std::size_t above = std::min(below + 1, samples.size() - 1);
  return samples[below] + (at - static_cast<double>(below)) * (samples[above] - samples[below]);
}

double mean(const std::vector<double>& samples) {
  if (samples.empty()) return 0;
  return std::accumulate(samples.begin(), samples.end(), 0.0) / static_cast<double>(samples.size());
}

std::string formatNumber(double value, int digits) {
  char text[64];
  const double size = std::abs(value);
  if (!std::isfinite(value) || (size != 0 && (size < 1e-4 || size >= 1e15))) {
    std::snprintf(text, sizeof(text), "%.*g", digits, value);
  } else {
    const int before = size >= 1 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
    const int zeros = size > 0 && size < 1 ? static_cast<int>(-std::floor(std::log10(size))) : 0;
    std::snprintf(text, sizeof(text), "%.*f", std::max(0, digits - before + zeros), value);
  }
  return text;
}

std::string formatVector(const Eigen::Vector3d& v, int digits, const char* between) {
  return formatNumber(v.x(), digits) + between + formatNumber(v.y(), digits) + between + formatNumber(v.z(), digits);
}

std::string formatPlain(double value) {
  char text[64];
  std::snprintf(text, sizeof(text), "%.12g", value);
  return text;
}

std::string formatExact(double value) {
  char text[64];
  const std::to_chars_result end = std::to_chars(text, text + sizeof(text), value);
  return {text, end.ptr};
}

std::string formatTime(double microseconds) {
  if (microseconds < 1e3) return formatNumber(microseconds) + " us";
  if (microseconds < 1e6) return formatNumber(microseconds / 1e3) + " ms";
  return formatNumber(microseconds / 1e6) + " s";
}

std::string formatBytes(double bytes) {
  if (bytes < 1e3) return formatNumber(bytes, 1) + " B";
  if (bytes < 1e6) return formatNumber(bytes / 1e3) + " kB";
  if (bytes < 1e9) return formatNumber(bytes / 1e6) + " MB";
  return formatNumber(bytes / 1e9) + " GB";
}

std::string formatRatio(double ratio) { return std::isfinite(ratio) ? formatNumber(ratio) + " x" : "-"; }

}  // namespace bocst::program
