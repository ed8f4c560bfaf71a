// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "picture/png.h"

namespace bocst::program {

/// A line of a plot.
struct PlotLine {
  enum class Style { kSolid, kDashed };

  std::string name;                               ///< In the legend; none if empty.
  std::string label;                              ///< At its right end; none if empty.
  std::vector<std::pair<double, double>> points;  ///< By x. With a logarithmic axis, 0 and less are left out.
  std::size_t colour = 0;                         ///< Lines of one colour belong together.
  Style style = Style::kSolid;
};

/// Lines over two axes, with a title, ticks, a grid and a legend.
struct Plot {
  std::string title, x_name, y_name;
  std::vector<double> x_ticks;  ///< Where figures stand under the axis; its range is theirs and that of the points.
  bool y_logarithmic = false;   ///< Else the y axis begins at 0.
  std::vector<PlotLine> lines;
};

/// Ticks at 1, 2 or 5 times a power of ten, about as many as wanted, from `low` or below to `high` or above.
std::vector<double> roundTicks(double low, double high, int wanted);

/// The same for a logarithmic axis of positive values: powers of ten, with their double and fivefold if there are few.
std::vector<double> logarithmicTicks(double low, double high);

/// Plots one below the other.
Picture drawPlots(const std::vector<Plot>& plots, int width, int height_of_each);

}  // namespace bocst::program
