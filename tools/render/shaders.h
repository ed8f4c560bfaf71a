// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace bocst::render {

/// The text of shaders/NAME.glsl, embedded when the tools are built. @throws std::logic_error for another name.
const std::string& shader(const std::string& name);

}  // namespace bocst::render
