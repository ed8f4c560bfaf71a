// SPDX-License-Identifier: BSD-3-Clause
#include "pair_page.h"

#include <chrono>
#include <filesystem>
#include <memory>

namespace bocst::program {

Page pairPage(const std::string& file_a, const Mesh& mesh_a, const std::string& file_b, const Mesh& mesh_b,
              const ModelArguments& model, const Pose& pose, std::size_t limit,
              const std::vector<std::pair<std::string, std::string>>& facts) {
  Options options = model.options();
  options.ttl = std::chrono::milliseconds(0);
  const std::unique_ptr<BocstPair> pair = makeBocstPair(model.scalarKind(), MeshArrays(mesh_a, model.scalarKind()),
                                                        MeshArrays(mesh_b, model.scalarKind()), options);
  const Eigen::Isometry3d X_AB = pose.transform();
  const std::vector<TouchingPoint> points = pair->touchingPoints(X_AB, limit);

  const std::string name_a = std::filesystem::path(file_a).filename().string();
  const std::string name_b = std::filesystem::path(file_b).filename().string();
  Page page(name_a + " and " + name_b);
  page.fact("A", name_a + ", " + std::to_string(mesh_a.triangleCount()) + " triangles");
  page.fact("B", name_b + ", " + std::to_string(mesh_b.triangleCount()) + " triangles");
  page.fact("B in A", pose.text());
  page.fact("answer", model.answerText());
  page.fact("they", points.empty() ? "do not collide" : "collide");
  page.fact("contacts", std::to_string(points.size()));
  page.fact("nodes grown", std::to_string(pair->statisticsA().resident_nodes) + " in A, " +
                               std::to_string(pair->statisticsB().resident_nodes) + " in B");
  for (const auto& [name, value] : facts) page.fact(name, value);
  page.object("A: " + name_a, mesh_a);
  page.tree(mesh_a, pair->nodesA(), options.subdivision, options.dimension);
  page.object("B: " + name_b, mesh_b, X_AB);
  page.tree(mesh_b, pair->nodesB(), options.subdivision, options.dimension);
  page.contacts(points);
  return page;
}

}  // namespace bocst::program
