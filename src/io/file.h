// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace bocst::io {

/// The bytes of a regular file. Never waits: what is a FIFO, a device, a socket or a directory is not opened.
/// @throws std::runtime_error if the file cannot be read, is empty or a Git LFS pointer, with the reason.
std::string readFile(const std::string& path);

}  // namespace bocst::io
