// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstring>
#include <string_view>

namespace bocst::io {

/// The number that `bytes` begins with; there must be enough of them.
template <typename Number>
Number number(std::string_view bytes, bool big_endian) {
  unsigned char raw[sizeof(Number)];
  std::memcpy(raw, bytes.data(), sizeof(Number));
  constexpr bool kHostIsBig = __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__;
  if (big_endian != kHostIsBig) std::reverse(raw, raw + sizeof(Number));
  Number value;
  std::memcpy(&value, raw, sizeof(Number));
  return value;
}

}  // namespace bocst::io
