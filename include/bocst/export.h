// SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Marks the symbols that the shared library exports; all other symbols are hidden.
#define BOCST_EXPORT __attribute__((visibility("default")))
