// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace bocst::oracle::gl {

/// The text of shaders/NAME.glsl, embedded when the library is built. @throws std::logic_error for another name.
const std::string& shader(const std::string& name);

}  // namespace bocst::oracle::gl
