// SPDX-License-Identifier: BSD-3-Clause
#include "picture/pair_picture.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "cli/report.h"
#include "cli/words.h"
#include "picture/marks.h"
#include "picture/picture_scene.h"

namespace bocst::program {
namespace {

using render::View;

/// From this level on a side's deepest nodes say where it was asked.
constexpr int kGrown = 3;

/// The least part of the overview that is worth a close-up.
constexpr double kLeastPart = 0.15;

/// Of surfaces that only show where they are.
constexpr float kGlass = 0.2f;

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

  std::vector<NodeView> frontier() const {
    std::vector<NodeView> result;
    std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(result),
                 [](const NodeView& node) { return node.children.empty(); });
    return result;
  }

  /// None where little grew.
  std::vector<NodeView> deepestNodes() const {
    std::vector<NodeView> result;
    const int level = deepest();
    if (level < kGrown) return result;
    std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(result),
                 [level](const NodeView& node) { return node.level == level; });
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
    view.radius = radiusToSee(room * box.sizes().head<2>().maxCoeff() / 2, view.center);
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
    sheet.panels.push_back({draw(all, side, surfaces(1), {}),
                            grown_.contacts.empty() ? "the objects" : "the objects and their contacts",
                            [&, frame](cairo_t* pen) {
                              markContacts(pen, grown_.contacts, all, side, false);
                              frame(pen);
                            }});
    sheet.panels.push_back({draw(all, side, surfaces(1), {sides_[0].frontier(), sides_[1].frontier()}),
                            "what grew: " + counted(grown_.pair->statisticsA().resident_nodes, "node") + " in A, " +
                                std::to_string(grown_.pair->statisticsB().resident_nodes) + " in B",
                            frame});
    if (!focus_.empty()) {
      const std::vector<std::vector<NodeView>> deepest = {sides_[0].deepestNodes(), sides_[1].deepestNodes()};
      const bool grown = !deepest[0].empty() || !deepest[1].empty();
      sheet.panels.push_back({draw(near, side, surfaces(grown ? kGlass : 1), deepest), closeUpLabel(),
                              [&](cairo_t* pen) { markContacts(pen, grown_.contacts, near, side, true); }});
    }
    return sheet.picture();
  }

 private:
  /// What the query was about: the contacts; without any, the deepest nodes; nothing where only roots were asked.
  void findFocus() {
    for (const TouchingPoint& contact : grown_.contacts) focus_.push_back(contact.position);
    if (!focus_.empty()) return;
    for (const Side& side : sides_) {
      for (const NodeView& node : side.deepestNodes()) focus_.push_back(side.pose * node.center);
    }
  }

  /// From the usual side, or from where more is seen of the focus, or else of both objects.
  void chooseAxes() {
    constexpr int kPixels = 160;
    std::vector<std::vector<Eigen::Vector3d>> points;
    if (focus_.empty()) {
      for (const Side& side : sides_) {
        points.push_back(some(cornersOf(side.mesh)));
        for (Eigen::Vector3d& point : points.back()) point = side.pose * point;
      }
    } else {
      points.push_back(some(focus_));
    }
    // Half of an object is at its back.
    const double good_enough = focus_.empty() ? 0.4 : 0.75;
    const render::Scene scene = surfaces(1);
    Eigen::Matrix3d best_axes = View::axesFrom(kTurn, kTilt, image_.upAxis());
    double best = 0;
    Progress progress("side", 24);
    for (const double tilt : {kTilt, 1.1, -kTilt}) {
      for (int eighth = 0; eighth < 8 && best < good_enough; ++eighth) {
        axes_ = View::axesFrom(kTurn + eighth * std::atan(1.0), tilt, image_.upAxis());
        double seen = 1;
        for (const std::vector<Eigen::Vector3d>& group : points) {
          seen = std::min(seen, static_cast<double>(renderer_.countSeen(scene, overview(), kPixels, group)) /
                                    static_cast<double>(group.size()));
        }
        progress.step();
        // Better by a little is not worth an unusual side.
        const double value = seen - good_enough * ((tilt == kTilt ? 0 : 0.2) + (eighth == 0 ? 0 : 0.06));
        if (value <= best + 0.03 * good_enough) continue;
        best = value;
        best_axes = axes_;
      }
    }
    axes_ = best_axes;
  }

  /// Vertices that no triangle has are no part of the surface.
  static std::vector<Eigen::Vector3d> cornersOf(const Mesh& mesh) {
    std::vector<Eigen::Vector3d> corners;
    for (const Mesh::Indices& t : mesh.triangles()) {
      for (const auto i : t) corners.push_back(mesh.vertex(i));
    }
    return corners;
  }

  /// Of many points a few hundred.
  static std::vector<Eigen::Vector3d> some(const std::vector<Eigen::Vector3d>& all) {
    constexpr std::size_t kMost = 400;
    std::vector<Eigen::Vector3d> result;
    for (std::size_t i = 0; i < all.size(); i += (all.size() + kMost - 1) / kMost) result.push_back(all[i]);
    return result;
  }

  render::Scene surfaces(float opacity) const {
    render::Scene scene;
    for (const Side& side : sides_) {
      scene.surfaces.push_back({&side.mesh, side.pose, kPairColors[side.index], opacity});
    }
    return scene;
  }

  /// All of both surfaces.
  View overview() const {
    Extent extent{{}, axes_};
    for (const Side& side : sides_) {
      for (const Eigen::Vector3d& v : cornersOf(side.mesh)) extent.add(side.pose * v);
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
      for (const NodeView& node : side.deepestNodes()) view.radius = std::max(view.radius, 6 * node.radius);
    }
    view.radius = std::clamp(view.radius, kLeastPart * all.radius, all.radius);
    // Nothing is beyond what the overview shows.
    const double most = all.radius - view.radius;
    const Eigen::Vector3d off = axes_ * (view.center - all.center);
    view.center -= axes_.topRows<2>().transpose() * (off - off.cwiseMax(-most).cwiseMin(most)).head<2>();
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

  /// With these nodes of A and B; opaque where the surfaces are not.
  render::Image draw(const View& view, int side_pixels, render::Scene scene,
                     const std::vector<std::vector<NodeView>>& nodes) const {
    const Options options = grown_.model.options();
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      const Side& side = sides_[i];
      render::Volumes volumes = volumesOf(nodes[i], side.mesh, options, image_.shape());
      volumes.pose = side.pose;
      volumes.color = kVolumeColors[i];
      if (scene.surfaces[i].opacity < 1) volumes.opacity = 1;
      scene.volumes.push_back(std::move(volumes));
    }
    return renderer_.draw(scene, view, side_pixels, side_pixels);
  }

  std::string closeUpLabel() const {
    std::string text;
    for (const Side& side : sides_) {
      if (side.deepest() < kGrown) continue;
      text += text.empty() ? "the frame, with the deepest nodes: level " : ", ";
      text += std::to_string(side.deepest()) + (side.index == 0 ? " in A" : " in B");
    }
    return text.empty() ? "the frame" : text;
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
  Eigen::Matrix3d axes_;
};

}  // namespace

Picture pairPicture(render::Renderer& renderer, const GrownPair& grown, const ImageArguments& image) {
  return Drawn(renderer, grown, image).picture();
}

}  // namespace bocst::program
