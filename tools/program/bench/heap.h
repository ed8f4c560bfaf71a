// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <optional>

namespace bocst::program {

/// Bytes that this process holds of the allocator, in all threads; nothing where the allocator does not tell.
std::optional<std::size_t> heapBytes();

}  // namespace bocst::program
