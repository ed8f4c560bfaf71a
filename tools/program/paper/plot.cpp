// SPDX-License-Identifier: BSD-3-Clause
#include "paper/plot.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cli/report.h"

namespace bocst::program {
namespace {

struct Colour {
  double red, green, blue;
};

// Okabe and Ito's, told apart by all eyes; the yellow is too light for lines.
constexpr std::array<Colour, 7> kColours = {{{0.00, 0.45, 0.70},
                                             {0.84, 0.37, 0.00},
                                             {0.00, 0.62, 0.45},
                                             {0.80, 0.47, 0.65},
                                             {0.90, 0.62, 0.00},
                                             {0.34, 0.71, 0.91},
                                             {0.20, 0.20, 0.20}}};
constexpr Colour kText{0.13, 0.13, 0.13};
constexpr Colour kAxis{0.55, 0.55, 0.55};
constexpr Colour kGrid{0.90, 0.90, 0.90};

constexpr double kTextSize = 15;
constexpr double kTitleSize = 17;
constexpr double kGap = 8;

struct Range {
  double low = std::numeric_limits<double>::max(), high = std::numeric_limits<double>::lowest();

  void add(double x) {
    low = std::min(low, x);
    high = std::max(high, x);
  }
  bool empty() const { return low > high; }
};

/// One plot on its part of the picture.
class Drawing {
 public:
  Drawing(cairo_t* pen, const Plot& plot, double top, double width, double height) : pen_(pen), plot_(plot) {
    cairo_select_font_face(pen_, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(pen_, kTextSize);
    for (const double x : plot.x_ticks) x_.add(x);
    Range values;
    for (const PlotLine& line : plot.lines) {
      for (const auto& [x, y] : line.points) {
        x_.add(x);
        if (shown(y)) values.add(y);
      }
    }
    if (values.empty()) values = {1, 10};
    if (x_.empty()) x_ = {0, 1};
    if (!(x_.low < x_.high)) x_ = {x_.low - 0.5, x_.high + 0.5};
    y_ticks_ = plot.y_logarithmic ? logarithmicTicks(values.low, values.high) : roundTicks(0, values.high, 5);
    y_ = {y_ticks_.front(), y_ticks_.back()};

    double tick_width = 0, label_width = 0;
    for (const double y : y_ticks_) tick_width = std::max(tick_width, widthOf(formatPlain(y)));
    for (const PlotLine& line : plot.lines) label_width = std::max(label_width, widthOf(line.label));
    left_ = kTextSize + 3 * kGap + tick_width;
    right_ = width - 2 * kGap - std::max(label_width, kTextSize);
    top_ = top + kTitleSize + kTextSize + 6 * kGap;
    bottom_ = top + height - 2 * kTextSize - 4 * kGap;
    header_ = top + kGap + kTitleSize;
  }

  void draw() {
    drawHeader();
    drawAxes();
    for (const PlotLine& line : plot_.lines) drawLine(line);
    drawLabels();
  }

 private:
  bool shown(double y) const { return std::isfinite(y) && (!plot_.y_logarithmic || y > 0); }

  double across(double x) const { return left_ + (x - x_.low) / (x_.high - x_.low) * (right_ - left_); }

  double up(double y) const {
    const double part =
        plot_.y_logarithmic ? std::log(y / y_.low) / std::log(y_.high / y_.low) : (y - y_.low) / (y_.high - y_.low);
    return bottom_ - part * (bottom_ - top_);
  }

  void use(const Colour& c) { cairo_set_source_rgb(pen_, c.red, c.green, c.blue); }

  static const Colour& colourOf(const PlotLine& line) { return kColours[line.colour % kColours.size()]; }

  double widthOf(const std::string& text) {
    cairo_text_extents_t extents;
    cairo_text_extents(pen_, text.c_str(), &extents);
    return extents.x_advance;
  }

  /// align: 0 begins at x, 1 ends there.
  void text(const std::string& text, double x, double baseline, double align) {
    cairo_move_to(pen_, x - align * widthOf(text), baseline);
    cairo_show_text(pen_, text.c_str());
  }

  void rule(double x0, double y0, double x1, double y1) {
    // On the middle of pixels, a line is one pixel wide.
    cairo_move_to(pen_, std::floor(x0) + 0.5, std::floor(y0) + 0.5);
    cairo_line_to(pen_, std::floor(x1) + 0.5, std::floor(y1) + 0.5);
    cairo_stroke(pen_);
  }

  void strokeStyle(const PlotLine& line) {
    use(colourOf(line));
    cairo_set_line_width(pen_, 2);
    const double dashes[] = {6, 4};
    cairo_set_dash(pen_, dashes, line.style == PlotLine::Style::kDashed ? 2 : 0, 0);
  }

  void marker(const PlotLine& line, double x, double y) {
    cairo_set_dash(pen_, nullptr, 0, 0);
    cairo_arc(pen_, x, y, 3.5, 0, 2 * M_PI);
    if (line.style == PlotLine::Style::kDashed) {
      cairo_set_source_rgb(pen_, 1, 1, 1);
      cairo_fill_preserve(pen_);
      use(colourOf(line));
      cairo_set_line_width(pen_, 1.5);
      cairo_stroke(pen_);
    } else {
      use(colourOf(line));
      cairo_fill(pen_);
    }
  }

  void drawHeader() {
    use(kText);
    cairo_set_font_size(pen_, kTitleSize);
    cairo_select_font_face(pen_, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_BOLD);
    text(plot_.title, 2 * kGap, header_, 0);
    cairo_set_font_size(pen_, kTextSize);
    cairo_select_font_face(pen_, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    double x = 2 * kGap;
    const double baseline = header_ + kTextSize + 1.5 * kGap;
    for (const PlotLine& line : plot_.lines) {
      if (line.name.empty()) continue;
      const double y = baseline - kTextSize / 3;
      strokeStyle(line);
      cairo_move_to(pen_, x, y);
      cairo_line_to(pen_, x + 34, y);
      cairo_stroke(pen_);
      marker(line, x + 17, y);
      use(kText);
      text(line.name, x + 34 + kGap, baseline, 0);
      x += 34 + 4 * kGap + widthOf(line.name);
    }
  }

  void drawAxes() {
    cairo_set_dash(pen_, nullptr, 0, 0);
    cairo_set_line_width(pen_, 1);
    for (const double y : y_ticks_) {
      use(kGrid);
      rule(left_, up(y), right_, up(y));
      use(kText);
      text(formatPlain(y), left_ - kGap, up(y) + kTextSize / 3, 1);
    }
    double free_from = 0;
    for (const double x : plot_.x_ticks) {
      use(kAxis);
      rule(across(x), bottom_, across(x), bottom_ + 5);
      const std::string figure = formatPlain(x);
      const double half = widthOf(figure) / 2;
      if (across(x) - half < free_from) continue;  // two ticks too near for both figures
      use(kText);
      text(figure, across(x), bottom_ + kTextSize + kGap, 0.5);
      free_from = across(x) + half + kGap;
    }
    use(kAxis);
    rule(left_, bottom_, right_, bottom_);
    rule(left_, top_, left_, bottom_);
    use(kText);
    text(plot_.x_name, (left_ + right_) / 2, bottom_ + 2 * kTextSize + 2 * kGap, 0.5);
    cairo_save(pen_);
    cairo_translate(pen_, kGap + kTextSize, (top_ + bottom_) / 2);
    cairo_rotate(pen_, -M_PI / 2);
    text(plot_.y_name, 0, 0, 0.5);
    cairo_restore(pen_);
  }

  void drawLine(const PlotLine& line) {
    strokeStyle(line);
    bool drawing = false;
    for (const auto& [x, y] : line.points) {
      if (!shown(y)) {
        drawing = false;
        continue;
      }
      if (drawing) {
        cairo_line_to(pen_, across(x), up(y));
      } else {
        cairo_move_to(pen_, across(x), up(y));
      }
      drawing = true;
    }
    cairo_stroke(pen_);
    for (const auto& [x, y] : line.points) {
      if (shown(y)) marker(line, across(x), up(y));
    }
  }

  void drawLabels() {
    std::vector<double> taken;
    for (const PlotLine& line : plot_.lines) {
      if (line.label.empty() || line.points.empty() || !shown(line.points.back().second)) continue;
      const double y = up(line.points.back().second);
      const auto hides = [y](double other) { return std::abs(y - other) < kTextSize; };
      if (std::any_of(taken.begin(), taken.end(), hides)) continue;
      taken.push_back(y);
      use(colourOf(line));
      text(line.label, right_ + kGap, y + kTextSize / 3, 0);
    }
  }

  cairo_t* pen_;
  const Plot& plot_;
  Range x_, y_;
  std::vector<double> y_ticks_;
  double left_ = 0, right_ = 0, top_ = 0, bottom_ = 0, header_ = 0;
};

}  // namespace

std::vector<double> roundTicks(double low, double high, int wanted) {
  if (!(high > low)) high = low + 1;
  const double raw = (high - low) / wanted;
  const double power = std::pow(10, std::floor(std::log10(raw)));
  double step = 10 * power;
  for (const double factor : {5.0, 2.0, 1.0}) {
    if (factor * power >= raw * (1 - 1e-9)) step = factor * power;
  }
  std::vector<double> ticks;
  for (double i = std::floor(low / step + 1e-9);; ++i) {
    ticks.push_back(i * step);
    if (i * step >= high * (1 - 1e-9)) return ticks;
  }
}

std::vector<double> logarithmicTicks(double low, double high) {
  const double first = std::floor(std::log10(low) + 1e-9), last = std::ceil(std::log10(high) - 1e-9);
  const bool few = last - first <= 3;
  std::vector<double> ticks;
  for (double decade = first; decade <= last; ++decade) {
    for (const double factor : {1.0, 2.0, 5.0}) {
      const double tick = factor * std::pow(10, decade);
      if (few || factor == 1.0) ticks.push_back(tick);
    }
  }
  // No more than one beyond the values on either side.
  while (ticks.size() > 2 && ticks[1] <= low * (1 + 1e-9)) ticks.erase(ticks.begin());
  while (ticks.size() > 2 && ticks[ticks.size() - 2] >= high * (1 - 1e-9)) ticks.pop_back();
  return ticks;
}

Picture drawPlots(const std::vector<Plot>& plots, int width, int height_of_each) {
  Picture picture = whitePicture(width, height_of_each * static_cast<int>(plots.size()));
  const Pen pen = penOn(picture);
  for (std::size_t i = 0; i < plots.size(); ++i) {
    Drawing(pen.get(), plots[i], height_of_each * static_cast<double>(i), width, height_of_each).draw();
  }
  return picture;
}

}  // namespace bocst::program
