// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace bocst::program {

/// The program: does what the command line asks for and returns the exit code.
int run(int argc, char** argv, const std::string& version);

}  // namespace bocst::program
