// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cli/report.h"
#include "mesh/health.h"
#include "mesh/sphere_error.h"
#include "pairs/query_pair.h"

namespace bocst::program {

/// Where the moving objects of a page are at once, chosen by a slider.
struct PageState {
  std::string name;
  std::vector<Eigen::Isometry3d> poses;                       ///< Of each moving object, in the page's frame.
  std::vector<std::pair<std::size_t, std::size_t>> contacts;  ///< Objects that touch each other.
  std::optional<double> clearance;
};

/// One HTML file that shows meshes with their sphere-trees in any browser with WebGL 2: all in itself, nothing is
/// fetched. Coordinates are shown as they are given; the frame of the page is that of the first object.
class Page {
 public:
  /// What is larger than these is shown in part, and the page says so.
  static constexpr std::size_t kMaxTriangles = 250000;  ///< Of an object: coarser triangles.
  static constexpr std::size_t kMaxNodes = 250000;      ///< Of a tree: the finest levels are left out.
  static constexpr std::size_t kMaxContacts = 20000;    ///< The first ones.
  static constexpr std::size_t kMaxFaults = 100000;     ///< Lines of faulty edges and triangles: the first ones.

  static constexpr std::size_t kMaxStates = 2000;  ///< The first ones.

  explicit Page(std::string title);

  /// A line of the table on the page.
  void fact(const std::string& name, const std::string& value);

  /// A mesh at a pose in the page's frame; trees added next are this object's.
  void object(const std::string& name, const Mesh& mesh, const Eigen::Isometry3d& pose = Eigen::Isometry3d::Identity());

  /// A tree of the last object, as Model::visit() gives it. @param errors by level, or empty.
  /// @param dimension Options::dimension of the tree.
  void tree(const Mesh& mesh, const std::vector<NodeView>& nodes, Subdivision subdivision, double dimension,
            const std::vector<LevelError>& errors = {});

  /// Edges and triangles of the last object that are faulty.
  void faults(const Mesh& mesh, const Faults& faults);

  /// In the page's frame. @param exact they are of triangles, not of cells.
  void contacts(const std::vector<TouchingPoint>& contacts, bool exact);

  /// Objects that move, by their numbers, and the states that there are; those to be shown follow by state().
  void moving(const std::vector<std::size_t>& objects, std::size_t states);
  void state(const PageState& state);

  std::string html() const;

 private:
  Json scene_;
};

/// Half the extents of the region of a node that its sphere is about: the cell's cube, or, with kBono, what of it is
/// inside the mesh's bounds.
Eigen::Vector3d halfRegion(const NodeView& node, const Mesh& mesh, Subdivision subdivision, double dimension);

}  // namespace bocst::program
