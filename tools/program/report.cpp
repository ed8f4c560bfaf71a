// SPDX-License-Identifier: BSD-3-Clause
#include "report.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <numeric>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void cannotWrite(const std::string& file, int error) {
  throw std::runtime_error(file + ": cannot be written: " + std::generic_category().message(error));
}

fs::path folderOf(const std::string& file) {
  const fs::path folder = fs::path(file).parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

/// Pipes and devices have no "whole or not at all".
bool isSpecial(const std::string& file) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  return fs::exists(status) && !fs::is_regular_file(status) && !fs::is_directory(status);
}

void writeAll(int fd, const std::string& text, const std::string& file) {
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t n = ::write(fd, text.data() + done, text.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) cannotWrite(file, errno);
    done += static_cast<std::size_t>(n);
  }
}

}  // namespace

void Output::check() const {
  if (json_file.empty() || json_file == "-") return;
  std::error_code error;
  if (fs::is_directory(json_file, error)) cannotWrite(json_file, EISDIR);
  const bool special = isSpecial(json_file);
  if (::access(special ? json_file.c_str() : folderOf(json_file).c_str(), W_OK) != 0) cannotWrite(json_file, errno);
}

void Output::write(const Json& json) const {
  const std::string text = json.dump(2) + "\n";
  if (json_file == "-") {
    std::cout << text << std::flush;
    if (!std::cout) throw std::runtime_error("stdout: cannot be written");
    return;
  }
  if (isSpecial(json_file)) {
    std::FILE* stream = std::fopen(json_file.c_str(), "w");
    if (stream == nullptr) cannotWrite(json_file, errno);
    const bool good = std::fputs(text.c_str(), stream) >= 0;
    if (std::fclose(stream) != 0 || !good) cannotWrite(json_file, errno);
    return;
  }
  // A temporary file beside it, then a rename, which replaces at once.
  std::string temporary = (folderOf(json_file) / (fs::path(json_file).filename().string() + ".XXXXXX")).string();
  const int fd = ::mkstemp(temporary.data());
  if (fd < 0) cannotWrite(json_file, errno);
  try {
    writeAll(fd, text, json_file);
    const mode_t mask = ::umask(0);
    ::umask(mask);
    if (::fchmod(fd, 0666 & ~mask) != 0) cannotWrite(json_file, errno);
  } catch (...) {
    ::close(fd);
    ::unlink(temporary.c_str());
    throw;
  }
  if (::close(fd) != 0 || std::rename(temporary.c_str(), json_file.c_str()) != 0) {
    const int error = errno;
    ::unlink(temporary.c_str());
    cannotWrite(json_file, error);
  }
}

void Table::print() const {
  std::vector<std::size_t> width;
  for (const auto& cells : rows_) {
    width.resize(std::max(width.size(), cells.size()));
    for (std::size_t i = 0; i < cells.size(); ++i) width[i] = std::max(width[i], cells[i].size());
  }
  for (const auto& cells : rows_) {
    std::string line;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string pad(width[i] - cells[i].size(), ' ');
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
      next_(std::chrono::steady_clock::now() + std::chrono::milliseconds(300)) {}

Progress::~Progress() {
  if (terminal_) std::fprintf(stderr, "\r\033[K");
}

void Progress::step() {
  ++done_;
  if (!terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(100);
  std::fprintf(stderr, "\r%s %zu of %zu", what_.c_str(), done_, total_);
  std::fflush(stderr);
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
  const int before = size >= 1 ? static_cast<int>(std::floor(std::log10(size))) + 1 : 1;
  if (size != 0 && (size < 1e-4 || size >= 1e15)) {
    std::snprintf(text, sizeof(text), "%.*g", digits, value);
  } else {
    const int zeros = size > 0 && size < 1 ? static_cast<int>(-std::floor(std::log10(size))) : 0;
    std::snprintf(text, sizeof(text), "%.*f", std::max(0, digits - before + zeros), value);
  }
  return text;
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

std::string formatRatio(double ratio) { return formatNumber(ratio) + " x"; }

}  // namespace bocst::program
