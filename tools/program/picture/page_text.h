// SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace bocst::program {

// The files of tools/program/page/, built into the program.
extern const char* const kPageTemplate;
extern const char* const kPageStyle;
extern const char* const kPageScript;

}  // namespace bocst::program
