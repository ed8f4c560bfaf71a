// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Before a loop over arrays of vectors: at -O2 the compiler keeps short loops, and with them the arrays in memory.
#define BOCST_UNROLL _Pragma("GCC unroll 9")
