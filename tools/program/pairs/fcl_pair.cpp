// SPDX-License-Identifier: BSD-3-Clause
// No bocst overload is in sight here, and FCL's functions for float, which libfcl does not have, are those in libbocst:
// compiling them takes a minute.
#include <bocst/fcl_templates.h>
#include <fcl/math/bv/OBB.h>
#include <fcl/math/bv/OBBRSS.h>
#include <fcl/math/bv/RSS.h>
#include <fcl/math/geometry.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>
#include <fcl/narrowphase/distance.h>

#include "pairs/fcl_calls.h"
#include "pairs/fcl_tree.h"
#include "pairs/pair_of.h"
#include "pairs/query_pair.h"

namespace bocst::program {
namespace {

template <typename BV>
class BvhPair : public PairOf<typename BV::S, fcl::BVHModel<BV>, FclPair, FclCalls> {
  using S = typename BV::S;

 public:
  using PairOf<S, fcl::BVHModel<BV>, FclPair, FclCalls>::PairOf;

  bool trianglesTouch(QueryPair::Contact triangles, const Eigen::Isometry3d& X_AB,
                      QueryPair::Order order) const override {
    // In the caller's order and in the first one's frame: so FCL rounds when it asks.
    const bool ab = order == QueryPair::Order::kAB;
    const fcl::BVHModel<BV>& first = ab ? this->a() : this->b();
    const fcl::BVHModel<BV>& second = ab ? this->b() : this->a();
    const fcl::Transform3<S> X_WA = fcl::Transform3<S>::Identity();
    const fcl::Transform3<S> X_WB = X_AB.cast<S>();
    fcl::Matrix3<S> R;
    fcl::Vector3<S> T;
    fcl::relativeTransform(ab ? X_WA : X_WB, ab ? X_WB : X_WA, R, T);
    const fcl::Triangle& p = first.tri_indices[ab ? triangles.first : triangles.second];
    const fcl::Triangle& q = second.tri_indices[ab ? triangles.second : triangles.first];
    return fcl::detail::Intersect<S>::intersect_Triangle(first.vertices[p[0]], first.vertices[p[1]],
                                                         first.vertices[p[2]], second.vertices[q[0]],
                                                         second.vertices[q[1]], second.vertices[q[2]], R, T);
  }

  void rebuildA(const MeshArrays& mesh) override { this->replaceA(buildFclTree<BV>(mesh)); }

  void refitA(const std::vector<Eigen::Vector3d>& vertices, FclPair::Refit refit) override {
    fcl::BVHModel<BV>& model = this->a();
    const auto& positions = verticesFor(vertices, S{});
    if (refit == FclPair::Refit::kNewPositions) {
      checkFclCode(model.beginReplaceModel());
      checkFclCode(model.replaceSubModel(positions));
      checkFclCode(model.endReplaceModel(true, true));
    } else {
      checkFclCode(model.beginUpdateModel());
      checkFclCode(model.updateSubModel(positions));
      checkFclCode(model.endUpdateModel(true, true));
    }
  }
};

template <typename BV>
std::unique_ptr<FclPair> buildPair(const MeshArrays& a, const MeshArrays& b) {
  return std::make_unique<BvhPair<BV>>(buildFclTree<BV>(a), buildFclTree<BV>(b));
}

template <typename S>
std::unique_ptr<FclPair> buildPair(FclTree tree, const MeshArrays& a, const MeshArrays& b) {
  switch (tree) {
    case FclTree::kObbRss:
      return buildPair<fcl::OBBRSS<S>>(a, b);
    case FclTree::kObb:
      return buildPair<fcl::OBB<S>>(a, b);
    case FclTree::kRss:
      return buildPair<fcl::RSS<S>>(a, b);
  }
  return nullptr;
}

}  // namespace

std::unique_ptr<FclPair> buildFclPair(FclTree tree, Scalar scalar, const MeshArrays& a, const MeshArrays& b) {
  return scalar == Scalar::kFloat ? buildPair<float>(tree, a, b) : buildPair<double>(tree, a, b);
}

std::size_t fclTreeBytes(Scalar scalar, std::size_t triangles) {
  const std::size_t node =
      scalar == Scalar::kFloat ? sizeof(fcl::BVNode<fcl::OBBRSS<float>>) : sizeof(fcl::BVNode<fcl::OBBRSS<double>>);
  return triangles == 0 ? 0 : (2 * triangles - 1) * node;
}

}  // namespace bocst::program
