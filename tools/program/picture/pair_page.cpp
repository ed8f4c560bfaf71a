// SPDX-License-Identifier: BSD-3-Clause
#include "picture/pair_page.h"

namespace bocst::program {

Page pairPage(const GrownPair& grown) {
  const Mesh& mesh_a = grown.mesh_a;
  const Mesh& mesh_b = grown.mesh_b;
  const Options options = grown.model.options();
  Page page(grown.name_a + " and " + grown.name_b);
  page.fact("A", grown.name_a + ", " + std::to_string(mesh_a.triangleCount()) + " triangles");
  page.fact("B", grown.name_b + ", " + std::to_string(mesh_b.triangleCount()) + " triangles");
  page.fact("B in A", grown.pose.text());
  page.fact("answer", grown.model.answerText());
  page.fact("they", grown.contacts.empty() ? "do not collide" : grown.model.exact() ? "collide" : "may touch");
  page.fact("contacts", std::to_string(grown.contacts.size()));
  page.fact("nodes grown", std::to_string(grown.pair->statisticsA().resident_nodes) + " in A, " +
                               std::to_string(grown.pair->statisticsB().resident_nodes) + " in B");
  for (const auto& [name, value] : grown.facts) page.fact(name, value);
  page.object("A: " + grown.name_a, mesh_a);
  page.tree(mesh_a, grown.pair->nodesA(), options.subdivision, options.dimension);
  page.object("B: " + grown.name_b, mesh_b, grown.pose.transform());
  page.tree(mesh_b, grown.pair->nodesB(), options.subdivision, options.dimension);
  page.contacts(grown.contacts, grown.model.exact());
  return page;
}

}  // namespace bocst::program
