// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string_view>
#include <utility>

#include "io/polygons.h"

namespace bocst::io {

/// The formats that have a reader of our own here.
enum class Format { kObj, kPly, kStl, kOff, kDae };

/// By what a file's name ends with.
constexpr std::pair<const char*, Format> kFormats[] = {
    {"obj", Format::kObj}, {"ply", Format::kPly}, {"stl", Format::kStl}, {"off", Format::kOff}, {"dae", Format::kDae}};

/// Reads the bytes of a mesh file; no other file is opened, and no locale matters.
/// @throws std::runtime_error saying what is wrong, and in which line or at which byte.
Polygons readMesh(std::string_view bytes, Format format);

Polygons readObj(std::string_view bytes);
Polygons readPly(std::string_view bytes);
Polygons readStl(std::string_view bytes);
Polygons readOff(std::string_view bytes);
Polygons readDae(std::string_view bytes);

}  // namespace bocst::io
