// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

namespace bocst::fuzz {

/// Numbers drawn from an input; zeros after its end, so a shorter input is a simpler one.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), end_(data + size) {}
  bool empty() const { return data_ == end_; }
  std::size_t left() const { return static_cast<std::size_t>(end_ - data_); }
  const std::uint8_t* rest() const { return data_; }
  std::uint8_t next() { return data_ == end_ ? std::uint8_t{0} : *data_++; }
  /// From 0 to n - 1, n up to 65536.
  int below(int n) {
    int x = next();
    if (n > 256) x += 256 * next();
    return x % n;
  }
  bool flip() { return next() & 1; }

 private:
  const std::uint8_t *data_, *end_;
};

/// A wrong answer: what the driver reports.
struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// One target, defined in the file that the driver is linked with. Throws Failure.
void testOneInput(const std::uint8_t* data, std::size_t size);

/// What was checked so far, for people.
std::string summary();

/// Tokens that a mutation may insert; ends with null.
extern const char* const kTokens[];

}  // namespace bocst::fuzz
