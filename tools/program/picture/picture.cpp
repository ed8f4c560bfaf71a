// SPDX-License-Identifier: BSD-3-Clause
#include "picture/picture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "cli/report.h"

namespace bocst::program {
namespace {

struct Measures {
  explicit Measures(const Sheet& sheet)
      : em(std::clamp(sheet.width / 95.0, 10.0, 26.0)),
        gap(std::round(0.9 * em)),
        head(std::round(5 * em)),
        label(std::round(2.3 * em)) {}

  double em, gap, head, label;
};

/// Cairo takes UTF-8 only.
std::string mended(const std::string& text) {
  return Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace)).get<std::string>();
}

double widthOf(cairo_t* pen, const std::string& text) {
  cairo_text_extents_t extents;
  cairo_text_extents(pen, text.c_str(), &extents);
  return extents.x_advance;
}

/// One line of text, no wider than `most`. @param align 0: from x on, 0.5: about x, 1: up to x.
/// @return its width.
double write(cairo_t* pen, double x, double y, double align, double size, double most, const std::string& raw) {
  const std::string text = mended(raw);
  cairo_set_font_size(pen, size);
  const double wanted = widthOf(pen, text);
  if (wanted > most) cairo_set_font_size(pen, size * most / wanted);
  const double width = std::min(wanted, most);
  cairo_move_to(pen, x - align * width, y);
  cairo_show_text(pen, text.c_str());
  return width;
}

void font(cairo_t* pen, cairo_font_weight_t weight, double grey) {
  cairo_select_font_face(pen, "sans-serif", CAIRO_FONT_SLANT_NORMAL, weight);
  cairo_set_source_rgb(pen, grey, grey, grey);
}

void drawHead(cairo_t* pen, const Sheet& sheet, const Measures& m) {
  const double most = sheet.width - 2 * m.gap;
  font(pen, CAIRO_FONT_WEIGHT_BOLD, 0.12);
  write(pen, m.gap, 2.2 * m.em, 0, 1.5 * m.em, most, sheet.title);
  font(pen, CAIRO_FONT_WEIGHT_NORMAL, 0.35);
  // The legend at the right, from its end.
  double right = sheet.width - m.gap;
  for (auto entry = sheet.legend.rbegin(); entry != sheet.legend.rend(); ++entry) {
    right -= write(pen, right, 4 * m.em, 1, m.em, 0.25 * most, entry->name) + 0.5 * m.em;
    const double side = 0.75 * m.em;
    cairo_save(pen);
    cairo_set_source_rgb(pen, entry->color.red, entry->color.green, entry->color.blue);
    cairo_rectangle(pen, right - side, 4 * m.em - side, side, side);
    cairo_fill(pen);
    cairo_restore(pen);
    right -= side + 1.4 * m.em;
  }
  write(pen, m.gap, 4 * m.em, 0, m.em, right - m.gap, sheet.subtitle);
}

void drawPanel(cairo_t* pen, const Panel& panel, const std::array<int, 2>& corner, int side, const Measures& m) {
  cairo_save(pen);
  cairo_translate(pen, corner[0], corner[1]);
  cairo_rectangle(pen, 0, 0, side, side);
  cairo_set_source_rgb(pen, 0.957, 0.965, 0.973);
  cairo_fill_preserve(pen);
  cairo_clip(pen);
  // Cairo only reads what is a source.
  auto* pixels = reinterpret_cast<unsigned char*>(const_cast<std::uint32_t*>(panel.image.pixels.data()));
  const Picture image(cairo_image_surface_create_for_data(pixels, CAIRO_FORMAT_ARGB32, panel.image.width,
                                                          panel.image.height, 4 * panel.image.width));
  cairo_set_source_surface(pen, image.get(), 0, 0);
  cairo_paint(pen);
  // The image is not ours: Cairo must not look at it later.
  cairo_set_source_rgb(pen, 0, 0, 0);
  if (panel.marks) panel.marks(pen);
  cairo_restore(pen);
  font(pen, CAIRO_FONT_WEIGHT_NORMAL, 0.2);
  write(pen, corner[0] + side / 2.0, corner[1] + side + 1.5 * m.em, 0.5, m.em, side, panel.label);
}

}  // namespace

int columnsFor(std::size_t panels) {
  constexpr std::size_t kMost = 5;
  if (panels <= kMost) return static_cast<int>(std::max<std::size_t>(panels, 1));
  const auto empty = [panels](std::size_t columns) { return (panels + columns - 1) / columns * columns - panels; };
  std::size_t best = kMost;
  for (std::size_t columns = kMost; columns >= 3; --columns) {
    if (empty(columns) < empty(best)) best = columns;
  }
  return static_cast<int>(best);
}

int Sheet::side() const {
  const Measures m(*this);
  return std::max(1, static_cast<int>((width - m.gap * (columns + 1)) / columns));
}

std::array<int, 2> Sheet::corner(std::size_t panel) const {
  const Measures m(*this);
  const auto across = static_cast<std::size_t>(columns);
  return {static_cast<int>(m.gap + static_cast<double>(panel % across) * (side() + m.gap)),
          static_cast<int>(m.head + static_cast<double>(panel / across) * (side() + m.label))};
}

Picture Sheet::picture() const {
  const Measures m(*this);
  const int bottom = panels.empty() ? 0 : corner(panels.size() - 1)[1] + side();
  Picture picture = whitePicture(width, bottom + static_cast<int>(m.label + m.gap));
  const Pen pen = penOn(picture);
  drawHead(pen.get(), *this, m);
  for (std::size_t i = 0; i < panels.size(); ++i) drawPanel(pen.get(), panels[i], corner(i), side(), m);
  check(pen);
  return picture;
}

}  // namespace bocst::program
