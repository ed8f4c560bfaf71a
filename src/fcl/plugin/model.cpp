// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/model.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "fcl/plugin/dispatch.h"
#include "tree/tree.h"

namespace bocst {
namespace {

// A double as an S that is not below (up) or not above (down) it.
template <typename S>
S roundUp(double x) {
  const S s = static_cast<S>(x);
  return static_cast<double>(s) < x ? std::nextafter(s, std::numeric_limits<S>::infinity()) : s;
}
template <typename S>
S roundDown(double x) {
  return -roundUp<S>(-x);
}

}  // namespace

namespace {

/// The box of the surface and its margin, which broadphase managers must not leave out, and a sphere about its middle
/// that holds the surface however it is turned: no larger than `radius` and the box's.
template <typename S>
void setBounds(fcl::CollisionGeometry<S>& geometry, Eigen::AlignedBox3d b, double margin, double radius) {
  const Eigen::Vector3d middle = b.center();
  margin *= 1 + 4e-16;
  b = Eigen::AlignedBox3d(b.min().array() - margin, b.max().array() + margin);
  for (int k = 0; k < 3; ++k) {
    geometry.aabb_local.min_[k] = roundDown<S>(b.min()[k]);
    geometry.aabb_local.max_[k] = roundUp<S>(b.max()[k]);
  }
  geometry.aabb_center = geometry.aabb_local.center();
  const Eigen::Vector3d center = geometry.aabb_center.template cast<double>();
  const double to_corner = (b.max() - center).cwiseMax(center - b.min()).norm();
  const double to_vertex = (center - middle).norm() + radius + margin;
  geometry.aabb_radius = roundUp<S>(std::min(to_corner, to_vertex) * (1 + 1e-15));
}

}  // namespace

template <typename S>
Model<S>::Model(std::shared_ptr<const Mesh> mesh, const Options& options)
    : tree_(std::make_unique<tree::Tree>(std::move(mesh), options)) {
  fcl_adapter::checkDispatch<S>();
  // Who asks geometries and poses needs no radius, so vertices are not looked through yet.
  setBounds(*this, tree_->bounds(), tree_->options().margin, HUGE_VAL);
}

template <typename S>
Model<S>::~Model() = default;

template <typename S>
const Options& Model<S>::options() const {
  return tree_->options();
}

template <typename S>
std::shared_ptr<const Mesh> Model<S>::mesh() const {
  return tree_->mesh();
}

template <typename S>
void Model<S>::releaseMesh() {
  tree_->releaseMesh();
}

template <typename S>
std::string Model<S>::oracleName() const {
  return tree_->oracle().name();
}

template <typename S>
Statistics Model<S>::statistics() const {
  return tree_->statistics();
}

template <typename S>
void Model<S>::expandAll(int depth) {
  tree_->expandAll(depth);
}

template <typename S>
void Model<S>::visit(const std::function<void(const NodeView&)>& f) const {
  tree_->visit(f);
}

template <typename S>
void Model<S>::prune(Clock::time_point now) {
  tree_->prune(now);
}

template <typename S>
void Model<S>::prune() {
  tree_->prune(Clock::time_point(std::chrono::nanoseconds(tree_->now())));
}

template <typename S>
void Model<S>::updateVertices(std::vector<Eigen::Vector3d> vertices) {
  tree_->updateVertices(std::move(vertices));
  setBounds(*this, tree_->bounds(), tree_->options().margin, HUGE_VAL);
}

template <typename S>
void Model<S>::computeLocalAABB() {
  setBounds(*this, tree_->bounds(), tree_->options().margin, tree_->radius());
}

namespace {

/// The mesh's integrals over the cone from the origin to each triangle: of 1, x, and x x^T.
struct Integrals {
  explicit Integrals(const std::shared_ptr<const Mesh>& mesh) {
    if (mesh == nullptr) throw std::logic_error("bocst::Model: the mesh was released, so its volume is not known");
    for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
      const Mesh::Indices& i = mesh->indices(t);
      const Eigen::Vector3d &a = mesh->vertex(i[0]), &b = mesh->vertex(i[1]), &c = mesh->vertex(i[2]), sum = a + b + c;
      const double six = a.cross(b).dot(c);
      volume += six / 6;
      first += six / 24 * sum;
      second += six / 120 * (a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose());
    }
  }

  double volume = 0;
  Eigen::Vector3d first = Eigen::Vector3d::Zero();
  Eigen::Matrix3d second = Eigen::Matrix3d::Zero();
};

}  // namespace

template <typename S>
S Model<S>::computeVolume() const {
  return static_cast<S>(Integrals(mesh()).volume);
}

template <typename S>
fcl::Vector3<S> Model<S>::computeCOM() const {
  const Integrals integrals(mesh());
  return (integrals.first / integrals.volume).template cast<S>();
}

template <typename S>
fcl::Matrix3<S> Model<S>::computeMomentofInertia() const {
  const Eigen::Matrix3d second = Integrals(mesh()).second;
  return (second.trace() * Eigen::Matrix3d::Identity() - second).template cast<S>();
}

template <typename S>
fcl::OBJECT_TYPE Model<S>::getObjectType() const {
  return fcl::OT_UNKNOWN;
}

template <typename S>
fcl::NODE_TYPE Model<S>::getNodeType() const {
  return fcl::GEOM_TRIANGLE;
}

template class Model<float>;
template class Model<double>;

}  // namespace bocst
