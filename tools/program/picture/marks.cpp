// SPDX-License-Identifier: BSD-3-Clause
#include "picture/marks.h"

#include <algorithm>
#include <cmath>

namespace bocst::program {
namespace {

/// Pixels that a thin line takes.
double unitOf(int side) { return std::max(side / 260.0, 1.0); }

void arrow(cairo_t* pen, const Eigen::Vector2d& from, const Eigen::Vector2d& to, double unit) {
  const double length = (to - from).norm();
  if (!(length > unit)) return;
  const Eigen::Vector2d along = (to - from) / length;
  const double head = std::min(4.5 * unit, 0.6 * length);
  const Eigen::Vector2d neck = to - head * along;
  const Eigen::Vector2d aside = 0.35 * head * Eigen::Vector2d(-along.y(), along.x());
  cairo_set_line_width(pen, 0.9 * unit);
  cairo_move_to(pen, from.x(), from.y());
  cairo_line_to(pen, neck.x(), neck.y());
  cairo_stroke(pen);
  cairo_move_to(pen, to.x(), to.y());
  cairo_line_to(pen, neck.x() + aside.x(), neck.y() + aside.y());
  cairo_line_to(pen, neck.x() - aside.x(), neck.y() - aside.y());
  cairo_fill(pen);
}

}  // namespace

void markContacts(cairo_t* pen, const std::vector<TouchingPoint>& contacts, const render::View& view, int side,
                  bool normals) {
  const double unit = unitOf(side);
  const double room = side / 28.0;
  const double dot = (normals && contacts.size() < 300 ? 1.2 : 0.8) * unit;
  cairo_set_source_rgb(pen, kContactColor.red, kContactColor.green, kContactColor.blue);
  std::vector<Eigen::Vector2d> arrows;
  for (const TouchingPoint& contact : contacts) {
    const Eigen::Vector2d at = view.toPixel(contact.position, side, side);
    cairo_arc(pen, at.x(), at.y(), dot, 0, 8 * std::atan(1.0));
    cairo_fill(pen);
    const auto near = [&](const Eigen::Vector2d& other) { return (other - at).norm() < room; };
    if (!normals || std::any_of(arrows.begin(), arrows.end(), near)) continue;
    arrows.push_back(at);
    const Eigen::Vector3d end = contact.position + kNormalLength * view.radius * contact.normal;
    arrow(pen, at, view.toPixel(end, side, side), unit);
  }
}

void markFaults(cairo_t* pen, const Faults& faults, const Mesh& mesh, const render::View& view, int side) {
  cairo_set_source_rgb(pen, kFaultColor.red, kFaultColor.green, kFaultColor.blue);
  cairo_set_line_width(pen, 1.2 * unitOf(side));
  cairo_set_line_cap(pen, CAIRO_LINE_CAP_ROUND);  // so that a point is seen, too
  for (const auto& [a, b] : faultLines(faults, mesh)) {
    const Eigen::Vector2d from = view.toPixel(mesh.vertex(a), side, side);
    const Eigen::Vector2d to = view.toPixel(mesh.vertex(b), side, side);
    cairo_move_to(pen, from.x(), from.y());
    cairo_line_to(pen, to.x(), to.y());
    cairo_stroke(pen);
  }
}

void markFrame(cairo_t* pen, const render::View& all, const render::View& near, int side) {
  const Eigen::Vector2d middle = all.toPixel(near.center, side, side);
  const double half = near.radius / all.radius * side / 2;
  cairo_set_source_rgba(pen, 0.1, 0.1, 0.1, 0.8);
  cairo_set_line_width(pen, 0.7 * unitOf(side));
  cairo_rectangle(pen, middle.x() - half, middle.y() - half, 2 * half, 2 * half);
  cairo_stroke(pen);
}

}  // namespace bocst::program
