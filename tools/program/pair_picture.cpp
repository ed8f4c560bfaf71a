// SPDX-License-Identifier: BSD-3-Clause
#include "pair_picture.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "picture_scene.h"

namespace bocst::program {
namespace {

using render::View;

constexpr render::Color kContactColor = {0.80f, 0.0f, 0.28f};

/// One of the two, with what grew.
struct Side {
  const Mesh& mesh;
  Eigen::Isometry3d pose;
  std::vector<NodeView> nodes;
  std::size_t index;  // 0 is A

  int deepest() const {
    int level = 1;
    for (const NodeView& node : nodes) level = std::max(level, node.level);
    return level;
  }

  /// Those without children from this level on.
  std::vector<NodeView> frontier(int from_level) const {
    std::vector<NodeView> result;
    std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(result),
                 [from_level](const NodeView& node) { return node.children.empty() && node.level >= from_level; });
    return result;
  }
};

/// A box along the axes of a view.
struct Extent {
  Eigen::AlignedBox3d box;
  Eigen::Matrix3d axes;

  void add(const Eigen::Vector3d& point) { box.extend(axes * point); }

  /// That it fills, with so much room about it.
  View view(double room) const {
    View view;
    view.axes = axes;
    view.center = axes.transpose() * box.center();
    view.radius = std::max(room * box.sizes().head<2>().maxCoeff() / 2, kSmallest);
    return view;
  }
};

class Drawn {
 public:
  Drawn(render::Renderer& renderer, const GrownPair& grown, const ImageArguments& image)
      : renderer_(renderer),
        grown_(grown),
        image_(image),
        sides_{{{grown.mesh_a, Eigen::Isometry3d::Identity(), grown.pair->nodesA(), 0},
                {grown.mesh_b, grown.pose.transform(), grown.pair->nodesB(), 1}}} {
    findFocus();
    chooseAxes();
  }

  Picture picture() const {
    Sheet sheet;
    sheet.title = grown_.name_a + " and " + grown_.name_b;
    sheet.subtitle = subtitle();
    sheet.legend = {{kVolumeColors[0], "A: " + grown_.name_a}, {kVolumeColors[1], "B: " + grown_.name_b}};
    if (!grown_.contacts.empty()) sheet.legend.push_back({kContactColor, "contacts"});
    sheet.width = image_.width;
    sheet.columns = focus_.empty() ? 2 : 3;
    const int side = sheet.side();
    const View all = overview();
    const View near = closeUp(all);
    const auto frame = [&, this](cairo_t* pen) {
      if (!focus_.empty()) markFrame(pen, all, near, side);
    };
    sheet.panels.push_back({draw(all, side, {}), "the objects", [&, frame](cairo_t* pen) {
                              markContacts(pen, all, side, false);
                              frame(pen);
                            }});
    sheet.panels.push_back({draw(all, side, {1, 1}),
                            "what grew: " + counted(grown_.pair->statisticsA().resident_nodes, "node") + " in A, " +
                                std::to_string(grown_.pair->statisticsB().resident_nodes) + " in B",
                            frame});
    if (!focus_.empty()) {
      sheet.panels.push_back({draw(near, side, {sides_[0].deepest(), sides_[1].deepest()}),
                              "the frame, with the deepest nodes: level " + std::to_string(sides_[0].deepest()) +
                                  " in A, " + std::to_string(sides_[1].deepest()) + " in B",
                              [&](cairo_t* pen) { markContacts(pen, near, side, true); }});
    }
    return sheet.picture();
  }

 private:
  /// What the query was about: the contacts; without any, the deepest nodes; nothing where only roots were asked.
  void findFocus() {
    for (const TouchingPoint& contact : grown_.contacts) focus_.push_back(contact.position);
    if (!focus_.empty()) return;
    for (const Side& side : sides_) {
      if (side.deepest() < 3) continue;
      for (const NodeView& node : side.frontier(side.deepest())) focus_.push_back(side.pose * node.center);
    }
  }

  /// From the usual side, or from where more of the focus is seen.
  void chooseAxes() {
    constexpr int kSide = 160;
    constexpr std::size_t kMostPoints = 400;
    axes_ = View::axesFrom(kTurn, kTilt, image_.upAxis());
    if (focus_.empty()) return;
    std::vector<Eigen::Vector3d> points;
    const std::size_t step = (focus_.size() + kMostPoints - 1) / kMostPoints;
    for (std::size_t i = 0; i < focus_.size(); i += step) points.push_back(focus_[i]);
    double best = -1;
    const render::Scene scene = surfaces();
    const Eigen::Matrix3d usual = axes_;
    for (const double tilt : {kTilt, 1.1, -kTilt}) {
      for (int eighth = 0; eighth < 8; ++eighth) {
        axes_ = View::axesFrom(kTurn + eighth * std::atan(1.0), tilt, image_.upAxis());
        const double seen = static_cast<double>(renderer_.countSeen(scene, overview(), kSide, points)) /
                            static_cast<double>(points.size());
        // Better by a little is not worth an unusual side.
        const double value = seen - (tilt == kTilt ? 0 : 0.15) - (eighth == 0 ? 0 : 0.05);
        if (value > best + 0.02) {
          best = value;
          best_axes_ = axes_;
        }
      }
    }
    axes_ = best > 0 ? best_axes_ : usual;
  }

  render::Scene surfaces() const {
    render::Scene scene;
    for (const Side& side : sides_) scene.surfaces.push_back({&side.mesh, side.pose, kSurfaceColors[side.index]});
    return scene;
  }

  /// All of both surfaces.
  View overview() const {
    Extent extent{{}, axes_};
    for (const Side& side : sides_) {
      for (const Eigen::Vector3d& v : side.mesh.vertices()) extent.add(side.pose * v);
    }
    return withReach(extent.view(1.12));
  }

  View closeUp(const View& all) const {
    if (focus_.empty()) return all;
    Extent extent{{}, axes_};
    for (const Eigen::Vector3d& point : focus_) extent.add(point);
    View view = extent.view(1.3);
    // A few of the deepest nodes at least, but no more than there is.
    for (const Side& side : sides_) {
      for (const NodeView& node : side.frontier(side.deepest())) view.radius = std::max(view.radius, 6 * node.radius);
    }
    view.radius = std::min(view.radius, all.radius);
    return withReach(view);
  }

  /// The spheres of the roots hold all that is drawn.
  View withReach(View view) const {
    view.reach = view.radius;
    for (const Side& side : sides_) {
      const NodeView& root = side.nodes.front();
      const double away = std::abs(axes_.row(2).dot(side.pose * root.center - view.center));
      view.reach = std::max(view.reach, 1.05 * (away + root.radius));
    }
    return view;
  }

  /// With each side's frontier from this level on, if any.
  render::Image draw(const View& view, int side_pixels, const std::vector<int>& from_levels) const {
    render::Scene scene = surfaces();
    const Options options = grown_.model.options();
    for (std::size_t i = 0; i < from_levels.size(); ++i) {
      const Side& side = sides_[i];
      render::Volumes volumes = volumesOf(side.frontier(from_levels[i]), side.mesh, options, image_.shape());
      volumes.pose = side.pose;
      volumes.color = kVolumeColors[i];
      scene.volumes.push_back(std::move(volumes));
    }
    return renderer_.draw(scene, view, side_pixels, side_pixels);
  }

  void markContacts(cairo_t* pen, const View& view, int side, bool normals) const {
    const double unit = std::max(side / 260.0, 1.0);
    cairo_set_source_rgb(pen, kContactColor.red, kContactColor.green, kContactColor.blue);
    for (const TouchingPoint& contact : grown_.contacts) {
      const Eigen::Vector2d at = view.toPixel(contact.position, side, side);
      cairo_arc(pen, at.x(), at.y(), (normals ? 1.2 : 0.9) * unit, 0, 8 * std::atan(1.0));
      cairo_fill(pen);
    }
    if (!normals) return;
    // As many arrows as have room.
    std::vector<Eigen::Vector2d> taken;
    for (const TouchingPoint& contact : grown_.contacts) {
      const Eigen::Vector2d at = view.toPixel(contact.position, side, side);
      const auto near = [&](const Eigen::Vector2d& other) { return (other - at).norm() < side / 28.0; };
      if (std::any_of(taken.begin(), taken.end(), near)) continue;
      taken.push_back(at);
      arrow(pen, at, view.toPixel(contact.position + 0.22 * view.radius * contact.normal, side, side), unit);
    }
  }

  static void arrow(cairo_t* pen, const Eigen::Vector2d& from, const Eigen::Vector2d& to, double unit) {
    const double length = (to - from).norm();
    if (!(length > unit)) return;
    const Eigen::Vector2d along = (to - from) / length;
    const Eigen::Vector2d aside(-along.y(), along.x());
    const double head = std::min(4.5 * unit, 0.6 * length);
    const Eigen::Vector2d neck = to - head * along;
    cairo_set_line_width(pen, 0.9 * unit);
    cairo_move_to(pen, from.x(), from.y());
    cairo_line_to(pen, neck.x(), neck.y());
    cairo_stroke(pen);
    cairo_move_to(pen, to.x(), to.y());
    for (const double s : {0.35, -0.35})
      cairo_line_to(pen, neck.x() + s * head * aside.x(), neck.y() + s * head * aside.y());
    cairo_fill(pen);
  }

  static void markFrame(cairo_t* pen, const View& all, const View& near, int side) {
    const Eigen::Vector2d middle = all.toPixel(near.center, side, side);
    const double half = near.radius / all.radius * side / 2;
    cairo_set_source_rgba(pen, 0.1, 0.1, 0.1, 0.8);
    cairo_set_line_width(pen, std::max(side / 400.0, 1.0));
    cairo_rectangle(pen, middle.x() - half, middle.y() - half, 2 * half, 2 * half);
    cairo_stroke(pen);
  }

  std::string subtitle() const {
    std::string text = grown_.contacts.empty() ? "They do not collide" : "They collide";
    if (!grown_.contacts.empty()) text += ": " + counted(grown_.contacts.size(), "contact");
    text += " · " + grown_.model.answerText() + " · " + nameOf(grown_.model.options().subdivision);
    for (const auto& [name, value] : grown_.facts) text += " · " + name + ": " + value;
    return text;
  }

  render::Renderer& renderer_;
  const GrownPair& grown_;
  const ImageArguments& image_;
  std::array<Side, 2> sides_;
  std::vector<Eigen::Vector3d> focus_;
  Eigen::Matrix3d axes_, best_axes_;
};

}  // namespace

Picture pairPicture(render::Renderer& renderer, const GrownPair& grown, const ImageArguments& image) {
  return Drawn(renderer, grown, image).picture();
}

}  // namespace bocst::program
