// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cairo.h>

#include <memory>
#include <string>

namespace bocst::program {

struct CairoEnd {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* context) const { cairo_destroy(context); }
};
using Picture = std::unique_ptr<cairo_surface_t, CairoEnd>;
using Pen = std::unique_ptr<cairo_t, CairoEnd>;

/// A white picture, CAIRO_FORMAT_RGB24. @throws std::runtime_error when it is larger than memory or Cairo allow.
Picture whitePicture(int width, int height);

/// What draws on it. @throws std::runtime_error
Pen penOn(const Picture& picture);

/// @throws std::runtime_error when something went wrong while it drew.
void check(const Pen& pen);

/// The bytes of a PNG file. @throws std::runtime_error
std::string png(const Picture& picture);

/// As writeFile() does: whole or not at all. @throws std::runtime_error
void writePng(const std::string& file, const Picture& picture);

}  // namespace bocst::program
