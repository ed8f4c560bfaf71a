// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/fcl.h>
#include <bocst/model.h>

#include "pairs/fcl_calls.h"
#include "pairs/pair_of.h"
#include "pairs/query_pair.h"

namespace bocst::program {
namespace {

template <typename S>
class ModelPair : public PairOf<S, Model<S>, BocstPair, FclCalls> {
 public:
  using PairOf<S, Model<S>, BocstPair, FclCalls>::PairOf;

  std::vector<TouchingPoint> touchingPoints(const Eigen::Isometry3d& X_AB, std::size_t limit) const override {
    const fcl::CollisionRequest<S> request(limit, true);
    fcl::CollisionResult<S> result;
    this->collide(X_AB, QueryPair::Order::kAB, request, result);
    std::vector<TouchingPoint> points;
    points.reserve(result.numContacts());
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
      const fcl::Contact<S>& c = result.getContact(i);
      points.push_back(
          {c.pos.template cast<double>(), c.normal.template cast<double>(), c.penetration_depth, {c.b1, c.b2}});
    }
    return points;
  }

  NearestPoints nearest(const Eigen::Isometry3d& X_AB) const override {
    const fcl::DistanceRequest<S> request(true);
    fcl::DistanceResult<S> result;
    this->measure(X_AB, request, result);
    return {result.min_distance,
            result.nearest_points[0].template cast<double>(),
            result.nearest_points[1].template cast<double>(),
            {result.b1, result.b2}};
  }

  void buildTrees() override {
    this->a().buildTree();
    this->b().buildTree();
  }

  void updateA(std::vector<Eigen::Vector3d> vertices) override { this->a().updateVertices(std::move(vertices)); }

  std::vector<NodeView> nodesA() const override { return nodesOf(this->a()); }
  std::vector<NodeView> nodesB() const override { return nodesOf(this->b()); }
  Statistics statisticsA() const override { return this->a().statistics(); }
  Statistics statisticsB() const override { return this->b().statistics(); }
  std::string oracleName() const override { return this->a().oracleName(); }

 private:
  static std::vector<NodeView> nodesOf(const Model<S>& model) {
    std::vector<NodeView> nodes;
    model.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
    return nodes;
  }
};

template <typename S>
std::unique_ptr<BocstPair> makePair(const MeshArrays& a, const MeshArrays& b, const Options& options) {
  const auto make = [&options](const MeshArrays& mesh) {
    return std::make_unique<Model<S>>(std::make_shared<const Mesh>(mesh.vertices, mesh.triangles), options);
  };
  return std::make_unique<ModelPair<S>>(make(a), make(b));
}

}  // namespace

MeshArrays::MeshArrays(const Mesh& mesh, Scalar scalar) : vertices(mesh.vertices()) {
  if (scalar == Scalar::kFloat) {
    for (Eigen::Vector3d& v : vertices) v = v.cast<float>().cast<double>();
  }
  triangles.reserve(mesh.triangleCount());
  for (std::size_t t = 0; t < mesh.triangleCount(); ++t) triangles.push_back(mesh.triangle(t));
}

std::unique_ptr<BocstPair> makeBocstPair(Scalar scalar, const MeshArrays& a, const MeshArrays& b,
                                         const Options& options) {
  return scalar == Scalar::kFloat ? makePair<float>(a, b, options) : makePair<double>(a, b, options);
}

std::unique_ptr<BocstPair> makeBocstPair(HandedOver&& a, HandedOver&& b, const Options& options) {
  const auto make = [&options](HandedOver& mesh) {
    return std::make_unique<Modeld>(Mesh::fromIndices(std::move(mesh.vertices), std::move(mesh.triangles)), options);
  };
  return std::make_unique<ModelPair<double>>(make(a), make(b));
}

}  // namespace bocst::program
