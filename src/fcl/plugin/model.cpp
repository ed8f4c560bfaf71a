// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/model.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "fcl/adapters/models.h"
#include "fcl/pair/query_scope.h"
#include "fcl/plugin/dispatch.h"
#include "log/log.h"
#include "log/number_text.h"
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

/// The box of the surface and its margin, which broadphase managers must not leave out, and a sphere about its middle
/// that holds the surface however it is turned: no larger than `radius` and the box's.
template <typename S>
void setBounds(fcl::CollisionGeometry<S>& geometry, Eigen::AlignedBox3d b, double margin, double radius) {
  const Eigen::Vector3d middle = b.center();
  // Rounded outwards, also where it is added.
  if (margin > 0) margin += 4e-16 * (b.min().cwiseAbs().cwiseMax(b.max().cwiseAbs()).maxCoeff() + margin);
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

/// The same from the box alone. Queries need no radius, so the vertices are not read.
template <typename S>
void setBoundsByBox(fcl::CollisionGeometry<S>& geometry, const tree::Tree& tree) {
  setBounds(geometry, tree.bounds(), tree.options().margin, HUGE_VAL);
}

/// Far from its origin a mesh has no details in S: there FCL's test of two triangles, which collide() shares, may say
/// anything.
template <typename S>
void warnIfFarFromOrigin(const tree::Tree& tree) {
  constexpr double kDetails = 1000;  // steps of S that a mesh is long, at least
  const Eigen::AlignedBox3d b = tree.bounds();
  const double far = b.min().cwiseAbs().cwiseMax(b.max().cwiseAbs()).maxCoeff();
  const double step = far * std::numeric_limits<S>::epsilon(), size = b.diagonal().norm();
  if (!(size > 0 && size < kDetails * step)) return;
  log(LogLevel::kWarning, "Model: coordinates of a mesh of size " + numberText(size) + ", up to " + numberText(far) +
                              " from its origin, are " + numberText(step) + " apart in its scalar type: move the " +
                              "mesh near its origin (and its poses back), or use double, else collide() may be wrong");
}

/// The codes of FCL's builder are easily ignored; what ends a sequence of calls says so, once.
int refused(const std::string& call, int code) {
  log(LogLevel::kError, "Model::" + call);
  return code;
}

}  // namespace

template <typename S>
struct Model<S>::Staged {
  bool update;  // of the vertices alone
  std::vector<Eigen::Vector3d> vertices;
  std::vector<fcl::Triangle> triangles;

  void add(const fcl::Vector3<S>& p) { vertices.push_back(p.template cast<double>()); }
  void add(const std::vector<fcl::Vector3<S>>& ps) {
    vertices.reserve(vertices.size() + ps.size());
    for (const fcl::Vector3<S>& p : ps) add(p);
  }
};

template <typename S>
Model<S>::Model(std::shared_ptr<const Mesh> mesh, const Options& options)
    : options_(options), tree_(std::make_unique<tree::Tree>(std::move(mesh), options)) {
  fcl_adapter::checkDispatch<S>();
  setBoundsByBox(*this, *tree_);
  warnIfFarFromOrigin<S>(*tree_);
}

template <typename S>
Model<S>::Model(const Options& options) : options_(options) {
  tree::checkOptions(options);
  fcl_adapter::checkDispatch<S>();
  computeLocalAABB();
}

template <typename S>
void Model<S>::setMesh(std::shared_ptr<const Mesh> mesh) {
  tree_ = std::make_unique<tree::Tree>(std::move(mesh), options_);
  staged_.reset();
  setBoundsByBox(*this, *tree_);
  warnIfFarFromOrigin<S>(*tree_);
}

template <typename S>
bool Model<S>::empty() const {
  if (tree_ != nullptr) return false;
  if (staged_ != nullptr) throw std::logic_error("bocst::Model: endModel() was not called");
  return true;
}

template <typename S>
int Model<S>::beginModel(int num_tris, int num_vertices) {
  tree_.reset();
  staged_ = std::make_unique<Staged>(Staged{false, {}, {}});
  if (num_vertices > 0) staged_->vertices.reserve(static_cast<std::size_t>(num_vertices));
  if (num_tris > 0) staged_->triangles.reserve(static_cast<std::size_t>(num_tris));
  computeLocalAABB();
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::addVertex(const fcl::Vector3<S>& p) {
  if (staged_ == nullptr || staged_->update) return fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE;
  staged_->add(p);
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::addTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3) {
  return addSubModel({p1, p2, p3}, {fcl::Triangle(0, 1, 2)});
}

template <typename S>
int Model<S>::addSubModel(const std::vector<fcl::Vector3<S>>& ps, const std::vector<fcl::Triangle>& ts) {
  if (staged_ == nullptr || staged_->update) return fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE;
  const std::size_t first = staged_->vertices.size();
  staged_->add(ps);
  for (const fcl::Triangle& t : ts) staged_->triangles.emplace_back(first + t[0], first + t[1], first + t[2]);
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::addSubModel(const std::vector<fcl::Vector3<S>>& ps) {
  return addSubModel(ps, {});
}

template <typename S>
int Model<S>::endModel() {
  if (staged_ == nullptr || staged_->update) {
    return refused("endModel() without beginModel()", fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  }
  const std::unique_ptr<Staged> staged = std::move(staged_);
  if (staged->vertices.empty() && staged->triangles.empty()) {
    return refused("endModel() after nothing was added; the model is empty", fcl::BVH_ERR_BUILD_EMPTY_MODEL);
  }
  setMesh(std::make_shared<const Mesh>(std::move(staged->vertices), staged->triangles));
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::beginUpdateModel() {
  if (tree_ == nullptr || staged_ != nullptr) {
    return refused(tree_ == nullptr ? "beginUpdateModel() of an empty model" : "beginUpdateModel() twice",
                   fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  }
  staged_ = std::make_unique<Staged>(Staged{true, {}, {}});
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::updateVertex(const fcl::Vector3<S>& p) {
  return updateSubModel({p});
}

template <typename S>
int Model<S>::updateTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3) {
  return updateSubModel({p1, p2, p3});
}

template <typename S>
int Model<S>::updateSubModel(const std::vector<fcl::Vector3<S>>& ps) {
  if (staged_ == nullptr || !staged_->update) return fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE;
  staged_->add(ps);
  return fcl::BVH_OK;
}

template <typename S>
int Model<S>::endUpdateModel(bool, bool) {
  if (staged_ == nullptr || !staged_->update) {
    return refused("endUpdateModel() without beginUpdateModel()", fcl::BVH_ERR_BUILD_OUT_OF_SEQUENCE);
  }
  const std::unique_ptr<Staged> staged = std::move(staged_);
  const std::shared_ptr<const Mesh> before = mesh();
  if (before != nullptr && staged->vertices.size() != before->vertexCount()) {
    return refused("endUpdateModel() after " + std::to_string(staged->vertices.size()) + " positions; the mesh has " +
                       std::to_string(before->vertexCount()) + " vertices and keeps its own",
                   fcl::BVH_ERR_INCORRECT_DATA);
  }
  updateVertices(std::move(staged->vertices));
  return fcl::BVH_OK;
}

template <typename S>
fcl::BVHModelType Model<S>::getModelType() const {
  return tree_ != nullptr ? fcl::BVH_MODEL_TRIANGLES : fcl::BVH_MODEL_UNKNOWN;
}

template <typename S>
Model<S>::~Model() = default;

template <typename S>
const Options& Model<S>::options() const {
  return options_;
}

template <typename S>
std::shared_ptr<const Mesh> Model<S>::mesh() const {
  return tree_ != nullptr && !tree_->isReleased() ? tree_->mesh() : nullptr;
}

template <typename S>
void Model<S>::releaseMesh() {
  fcl_adapter::treeOf(*this).releaseMesh();
}

template <typename S>
std::string Model<S>::oracleName() const {
  return fcl_adapter::treeOf(*this).oracle().name();
}

template <typename S>
Statistics Model<S>::statistics() const {
  return tree_ != nullptr ? tree_->statistics() : Statistics{};
}

template <typename S>
void Model<S>::buildTree() {
  tree::Tree& tree = fcl_adapter::treeOf(*this);
  if (!tree.gainsByBuild()) return;
  const fcl_adapter::QueryScope scope(tree);
  tree.build();
}

template <typename S>
void Model<S>::expandAll(int depth) {
  fcl_adapter::treeOf(*this).expandAll(depth);
}

template <typename S>
void Model<S>::visit(const std::function<void(const NodeView&)>& f) const {
  if (tree_ != nullptr) tree_->visit(f);
}

template <typename S>
void Model<S>::prune(Clock::time_point now) {
  if (tree_ != nullptr) tree_->prune(now);
}

template <typename S>
void Model<S>::prune() {
  if (tree_ != nullptr) tree_->prune(Clock::time_point(std::chrono::nanoseconds(tree_->now())));
}

template <typename S>
void Model<S>::updateVertices(std::vector<Eigen::Vector3d> vertices) {
  fcl_adapter::treeOf(*this).updateVertices(std::move(vertices));
  setBoundsByBox(*this, *tree_);
}

template <typename S>
void Model<S>::computeLocalAABB() {
  if (tree_ == nullptr) {
    // A point, so that managers may sort it.
    this->aabb_local = fcl::AABB<S>(fcl::Vector3<S>::Zero().eval());
    this->aabb_center.setZero();
    this->aabb_radius = 0;
    return;
  }
  setBounds(*this, tree_->bounds(), tree_->options().margin, tree_->radius());
}

namespace {

/// The mesh's integrals over the cone from the origin to each triangle: of 1, x, and x x^T.
struct Integrals {
  explicit Integrals(const std::shared_ptr<const Mesh>& mesh) {
    if (mesh == nullptr)
      throw std::logic_error("bocst::Model: no mesh (released, or empty), so its volume is not known");
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
