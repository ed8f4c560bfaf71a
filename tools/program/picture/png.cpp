// SPDX-License-Identifier: BSD-3-Clause
#include "picture/png.h"

#include <new>
#include <stdexcept>

#include "cli/file.h"

namespace bocst::program {
namespace {

void check(cairo_status_t status) {
  if (status != CAIRO_STATUS_SUCCESS) {
    throw std::runtime_error(std::string("the picture cannot be made: ") + cairo_status_to_string(status));
  }
}

/// Cairo is C: nothing may be thrown through it.
cairo_status_t append(void* text, const unsigned char* bytes, unsigned int count) {
  try {
    static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), count);
    return CAIRO_STATUS_SUCCESS;
  } catch (const std::bad_alloc&) {
    return CAIRO_STATUS_NO_MEMORY;
  }
}

}  // namespace

Picture whitePicture(int width, int height) {
  Picture picture(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height));
  check(cairo_surface_status(picture.get()));
  const Pen pen = penOn(picture);
  cairo_set_source_rgb(pen.get(), 1, 1, 1);
  cairo_paint(pen.get());
  check(pen);
  return picture;
}

Pen penOn(const Picture& picture) {
  Pen pen(cairo_create(picture.get()));
  check(pen);
  return pen;
}

void check(const Pen& pen) { check(cairo_status(pen.get())); }

std::string png(const Picture& picture) {
  std::string text;
  check(cairo_surface_status(picture.get()));
  check(cairo_surface_write_to_png_stream(picture.get(), append, &text));
  return text;
}

void writePng(const std::string& file, const Picture& picture) { writeFile(file, png(picture)); }

}  // namespace bocst::program
