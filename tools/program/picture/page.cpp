// SPDX-License-Identifier: BSD-3-Clause
#include "picture/page.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "mesh/node_levels.h"
#include "picture/display_mesh.h"
#include "picture/page_text.h"

namespace bocst::program {
namespace {

std::string base64(const void* data, std::size_t size) {
  static const char* const kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const auto* bytes = static_cast<const unsigned char*>(data);
  std::string text;
  text.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const std::size_t left = std::min<std::size_t>(size - i, 3);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < left ? bytes[i + k] : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= left ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

template <typename T>
std::string base64(const std::vector<T>& data) {
  return base64(data.data(), data.size() * sizeof(T));
}

/// All but the finest levels that are too many.
int levelsToShow(const std::vector<std::size_t>& counts) {
  std::size_t sum = 0;
  int level = 0;
  for (const std::size_t count : counts) {
    sum += count;
    if (sum > Page::kMaxNodes) break;
    ++level;
  }
  return std::max(level, 1);
}

void replace(std::string& text, const std::string& what, const std::string& by) {
  text.replace(text.find(what), what.size(), by);
}

}  // namespace

Eigen::Vector3d halfRegion(const NodeView& node, const Mesh& mesh, Subdivision subdivision, double dimension) {
  if (subdivision == Subdivision::kOctree) return Eigen::Vector3d::Constant(node.radius / std::sqrt(3.0));
  // The lattice starts at the corner of the bounds, and a region at the corner of its cell.
  const double largest = mesh.bounds().sizes().maxCoeff();
  const double side = std::ldexp(largest / (dimension > 0 ? dimension : 65536), node.n);
  const Eigen::Vector3d cell(node.cell[0], node.cell[1], node.cell[2]);
  return (node.center - mesh.bounds().min() - side * cell).cwiseMax(0);
}

Page::Page(std::string title)
    : scene_{{"title", std::move(title)}, {"facts", Json::array()}, {"objects", Json::array()}} {}

void Page::fact(const std::string& name, const std::string& value) { scene_["facts"].push_back({name, value}); }

void Page::object(const std::string& name, const Mesh& mesh, const Eigen::Isometry3d& pose) {
  const DisplayMesh shown = displayMesh(mesh, kMaxTriangles);
  const Eigen::Matrix4d matrix = pose.matrix();
  scene_["objects"].push_back({{"name", name},
                               {"pose", std::vector<double>(matrix.data(), matrix.data() + 16)},  // by columns
                               {"center", list(mesh.bounds().center())},
                               {"size", displaySize(mesh)},
                               {"triangles", mesh.triangleCount()},
                               {"shown", shown.triangles()},
                               {"positions", base64(shown.positions)},
                               {"indices", base64(shown.indices)},
                               {"trees", Json::array()}});
}

void Page::tree(const Mesh& mesh, const std::vector<NodeView>& nodes, Subdivision subdivision, double dimension,
                const std::vector<LevelError>& errors) {
  const std::vector<std::size_t> counts = nodesPerLevel(nodes);
  const int levels = levelsToShow(counts);
  // Centre, half extents and radius of each node, in the cube that positions are in: [-1/2, 1/2] on each axis.
  std::vector<float> numbers;
  std::vector<std::uint8_t> level_of;
  std::vector<std::uint8_t> is_leaf;
  for (const NodeView& node : nodes) {
    if (node.level > levels) continue;
    const double scale = 1 / displaySize(mesh);
    const Eigen::Vector3d center = (node.center - mesh.bounds().center()) * scale;
    const Eigen::Vector3d half = halfRegion(node, mesh, subdivision, dimension) * scale;
    for (const double x : {center.x(), center.y(), center.z(), half.x(), half.y(), half.z(), node.radius * scale}) {
      numbers.push_back(static_cast<float>(x));
    }
    level_of.push_back(static_cast<std::uint8_t>(node.level));
    is_leaf.push_back(node.children.empty() ? 1 : 0);
  }
  Json by_level = Json::array();
  for (const LevelError& e : errors) by_level.push_back({e.min, e.average, e.max});
  scene_["objects"].back()["trees"].push_back({{"name", subdivision == Subdivision::kOctree ? "O-BOCST" : "B-BOCST"},
                                               {"counts", counts},
                                               {"levels", levels},
                                               {"errors", by_level},
                                               {"numbers", base64(numbers)},
                                               {"level_of", base64(level_of)},
                                               {"is_leaf", base64(is_leaf)}});
}

void Page::faults(const Mesh& mesh, const Faults& faults) {
  // Lines in the mesh's frame, which is the object's.
  std::vector<double> numbers;
  std::size_t lines = 0;
  for (const auto& [a, b] : faultLines(faults, mesh)) {
    if (++lines > kMaxFaults) break;
    const Eigen::Vector3d& p = mesh.vertex(a);
    const Eigen::Vector3d& q = mesh.vertex(b);
    numbers.insert(numbers.end(), {p.x(), p.y(), p.z(), q.x(), q.y(), q.z()});
  }
  scene_["objects"].back()["faults"] = base64(numbers);
}

void Page::contacts(const std::vector<TouchingPoint>& contacts, bool exact) {
  std::vector<double> numbers;
  for (std::size_t i = 0; i < std::min(contacts.size(), kMaxContacts); ++i) {
    const TouchingPoint& c = contacts[i];
    numbers.insert(numbers.end(), c.position.data(), c.position.data() + 3);
    numbers.insert(numbers.end(), c.normal.data(), c.normal.data() + 3);
    numbers.insert(numbers.end(), {c.depth, double(c.triangles.first), double(c.triangles.second)});
  }
  scene_["contacts"] = {
      {"total", contacts.size()}, {"of", exact ? "triangles" : "cells"}, {"numbers", base64(numbers)}};
}

void Page::moving(const std::vector<std::size_t>& objects, std::size_t states) {
  scene_["states"] = {{"moving", objects}, {"total", states}, {"list", Json::array()}};
}

void Page::state(const PageState& state) {
  std::vector<double> numbers;  // 4x4, by columns
  for (const Eigen::Isometry3d& X : state.poses) {
    const Eigen::Matrix4d matrix = X.matrix();
    numbers.insert(numbers.end(), matrix.data(), matrix.data() + 16);
  }
  Json contacts = Json::array();
  for (const auto& [a, b] : state.contacts) contacts.push_back({a, b});
  scene_["states"]["list"].push_back({{"name", state.name},
                                      {"poses", base64(numbers)},
                                      {"contacts", contacts},
                                      {"clearance", state.clearance ? Json(*state.clearance) : Json()}});
}

std::string Page::html() const {
  std::string scene = scene_.dump(-1, ' ', true, Json::error_handler_t::replace);
  // Nothing in a name may end the element that holds the scene.
  for (std::size_t at = 0; (at = scene.find('<', at)) != std::string::npos;) scene.replace(at, 1, "\\u003c");
  std::string html = kPageTemplate;
  replace(html, "{{style}}", kPageStyle);
  replace(html, "{{script}}", kPageScript);
  replace(html, "{{scene}}", scene);
  return html;
}

}  // namespace bocst::program
