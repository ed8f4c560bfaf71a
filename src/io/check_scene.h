// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>

namespace bocst::io {

/// Refuses valid files that assimp would misread without an error or crash on: glTF (by `ending`, in lower case, or by
/// content) that relies on an extension about geometry or on a skin's default matrices, and AMF that places its
/// objects.
/// @throws std::runtime_error with the reason and what to export instead.
void refuseMisread(std::string_view bytes, std::string_view ending);

}  // namespace bocst::io
