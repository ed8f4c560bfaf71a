// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cairo.h>

#include <array>
#include <functional>
#include <string>
#include <vector>

#include "picture/png.h"
#include "render/renderer.h"

namespace bocst::program {

/// A square view with a line of text under it.
struct Panel {
  render::Image image;
  std::string label;
  std::function<void(cairo_t*)> marks;  ///< Drawn over the image, in its pixels; may be empty.
};

/// Views side by side, in rows, under a title.
struct Sheet {
  struct Entry {
    render::Color color;
    std::string name;
  };

  std::string title;
  std::string subtitle;
  std::vector<Entry> legend;
  int width = 1600;  ///< Pixels; the height follows.
  int columns = 1;
  std::vector<Panel> panels;

  /// Pixels a side of a view.
  int side() const;

  /// The upper left corner of a view, in the picture's pixels.
  std::array<int, 2> corner(std::size_t panel) const;

  /// Text that is not UTF-8 is mended, and made smaller where it is too long. @throws std::runtime_error
  Picture picture() const;
};

/// The fewest columns, of at most five, that leave the fewest places empty.
int columnsFor(std::size_t panels);

}  // namespace bocst::program
