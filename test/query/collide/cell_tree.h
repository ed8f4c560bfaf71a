// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "meshes.h"
#include "query/sides/side.h"
#include "query/sides/visitor.h"

namespace bocst::test {

/// The tree of a model with conservative answers, grown as far as it may be, and its leaves.
struct CellTree {
  CellTree(const Raw& raw, Subdivision subdivision_, int depth_)
      : mesh(raw.mesh()), subdivision(subdivision_), depth(depth_), whole(fresh()) {
    whole->expandAll(depth);
    collect(query::TreeSide(*whole), tree::NodeRef());
  }

  std::unique_ptr<tree::Tree> fresh() const {
    Options options;
    options.answer = Answer::kConservative;
    options.subdivision = subdivision;
    options.depth = depth;
    options.ttl = std::chrono::milliseconds(0);
    return std::make_unique<tree::Tree>(mesh, options);
  }

  std::shared_ptr<const Mesh> mesh;
  Subdivision subdivision;
  int depth;
  std::unique_ptr<tree::Tree> whole;
  std::vector<query::CellLeaf> leaves;

 private:
  void collect(const query::TreeSide& side, tree::NodeRef node) {
    if (side.state(node) == query::State::kLeaf) {
      leaves.push_back({side.cellId(node), side.cellSphere(node)});
    } else {
      side.children(node, [&](tree::NodeRef child) { collect(side, child); });
    }
  }
};

}  // namespace bocst::test
