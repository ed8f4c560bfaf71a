// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

namespace bocst::program {

/// Fails now rather than after minutes of work. Empty names and "-" (stdout) are no files.
/// @throws std::runtime_error when one of the outputs cannot be written, or is another output, one of the inputs, or a
/// file that readFile() has read.
void checkOutputs(const std::vector<std::string>& outputs, const std::vector<std::string>& inputs);

/// The whole of a text file. @throws std::runtime_error when it cannot be read.
std::string readFile(const std::string& file);

/// A regular file appears whole or not at all: it is written beside its place and renamed. Pipes and devices are
/// written to as they are. @throws std::runtime_error when that fails.
void writeFile(const std::string& file, const std::string& text);

/// From here on SIGINT, SIGTERM and SIGHUP leave no partial file behind, and say so in one line; the exit status is the
/// signal's.
void cleanUpOnSignals();

}  // namespace bocst::program
