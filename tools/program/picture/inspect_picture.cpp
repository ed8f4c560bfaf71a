// SPDX-License-Identifier: BSD-3-Clause
#include "picture/inspect_picture.h"

#include <algorithm>
#include <filesystem>

#include "cli/report.h"
#include "cli/words.h"
#include "mesh/spheres.h"
#include "picture/marks.h"
#include "picture/picture_scene.h"

namespace bocst::program {

render::View viewOf(const NodeView& root, render::Up up) {
  render::View view;
  view.axes = render::View::axesFrom(kTurn, kTilt, up);
  view.center = root.center;
  view.radius = radiusToSee(1.03 * root.radius, root.center);
  view.reach = 1.05 * view.radius;
  return view;
}

Picture inspectPicture(render::Renderer& renderer, const std::string& file, const Mesh& mesh,
                       const std::vector<NodeView>& nodes, const Faults& faults, const Options& options,
                       const ImageArguments& image) {
  Sheet sheet;
  sheet.title = std::filesystem::path(file).filename().string();
  sheet.subtitle = counted(mesh.triangleCount(), "triangle") + " · " + nameOf(options.subdivision) + ", " +
                   image.nodes + " of the tree as it ends at each level";
  sheet.width = image.width;
  int levels = 0;
  for (const NodeView& node : nodes) levels = std::max(levels, node.level);
  sheet.columns = columnsFor(static_cast<std::size_t>(levels) + 1);

  const render::View view = viewOf(nodes.front(), image.upAxis());
  const auto draw = [&](const std::vector<NodeView>& shown) {
    render::Scene scene;
    scene.surfaces.push_back({&mesh, Eigen::Isometry3d::Identity(), kMeshColor, 1});
    scene.volumes.push_back(volumesOf(shown, mesh, options, image.shape()));
    return renderer.draw(scene, view, sheet.side(), sheet.side());
  };
  Progress progress("view", static_cast<std::size_t>(levels));
  const std::size_t marked = faultLines(faults, mesh).size();
  sheet.panels.push_back({draw({}), marked == 0 ? "the mesh" : "the mesh · faults in red",
                          [&](cairo_t* pen) { markFaults(pen, faults, mesh, view, sheet.side()); }});
  for (int level = 1; level <= levels; ++level) {
    const auto count =
        std::count_if(nodes.begin(), nodes.end(), [level](const NodeView& n) { return n.level == level; });
    sheet.panels.push_back({draw(leavesAt(nodes, level)),
                            "level " + std::to_string(level) + " · " + counted(static_cast<std::size_t>(count), "node"),
                            {}});
    progress.step();
  }
  return sheet.picture();
}

}  // namespace bocst::program
