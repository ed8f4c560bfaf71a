// SPDX-License-Identifier: BSD-3-Clause
#include "scene/bounds.h"

#include <fcl/config.h>
#include <fcl/geometry/shape/utility.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <iterator>
#include <limits>
#include <memory>
#include <mutex>
#include <shared_mutex>
#include <unordered_map>

#include "fcl/adapters/models.h"
#include "fcl/adapters/octree_side.h"
#include "fcl/adapters/shapes.h"
#include "scene/reach.h"
#include "thread/fork.h"
#include "thread/sharded_lock.h"
#include "tree/tree.h"

namespace bocst::scene {
namespace {

/// Of two GJK solvers, whose default tolerance is 1e-6, absolute or of the sizes.
constexpr double kSolverReach = 4e-6;

/// The better of the box along the frame's axes and the one along the principal axes. each(f) calls f for all points.
template <typename Each>
Bounds fit(Each&& each) {
  Eigen::AlignedBox3d box;
  each([&](const Eigen::Vector3d& p) { box.extend(p); });
  Bounds b;
  if (box.isEmpty()) {
    b.kind = Bounds::kNowhere;
    return b;
  }
  const Eigen::Vector3d middle = box.center();
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  each([&](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = p - middle;
    sum += q;
    moments += q * q.transpose();
    count += 1;
  });
  const auto area = [](const Eigen::Vector3d& h) { return h[0] * h[1] + h[1] * h[2] + h[2] * h[0]; };
  b.center = middle;
  b.half = box.sizes() / 2;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(moments - sum * sum.transpose() / count);
  if (solver.info() == Eigen::Success && solver.eigenvectors().allFinite()) {
    const Eigen::Matrix3d axes = solver.eigenvectors();
    Eigen::AlignedBox3d turned;
    each([&](const Eigen::Vector3d& p) { turned.extend(axes.transpose() * (p - middle)); });
    if (area(turned.sizes() / 2) < area(b.half)) {
      b.axes = axes;
      b.center = middle + axes * turned.center();
      b.half = turned.sizes() / 2;
    }
  }
  // What rounding of the sums above may have cut off.
  b.half.array() += 16 * std::numeric_limits<double>::epsilon() * (b.half.norm() + middle.norm());
  return b;
}

template <typename S>
Bounds aligned(const fcl::AABB<S>& box) {
  Bounds b;
  const Eigen::Vector3d lo = box.min_.template cast<double>(), hi = box.max_.template cast<double>();
  b.center = (lo + hi) / 2;
  b.half = (hi - lo) / 2;
  return b;
}

/// About the triangles of a mesh.
Bounds fitMesh(const Mesh& mesh) {
  const Eigen::AlignedBox3d box = mesh.bounds();
  // Vertices of no triangle may lie anywhere.
  return fit([&](auto&& f) {
    for (std::size_t i = 0; i < mesh.vertexCount(); ++i) {
      if (box.contains(mesh.vertex(i))) f(mesh.vertex(i));
    }
  });
}

/// The bounds of the meshes of this process, for planners that make a scene for each plan of the same models. Nobody
/// waits for another, nor in a child after fork() for a thread of the parent: the box is found again instead.
class MeshBounds {
 public:
  Bounds of(const std::shared_ptr<const Mesh>& mesh) {
    if (const std::unique_lock<thread::ForkAwareMutex> lock(mutex_, std::try_to_lock); lock.owns_lock()) {
      const auto known = bounds_.find(mesh.get());
      // Another mesh may have had this address.
      if (known != bounds_.end() && known->second.mesh.lock() == mesh) return known->second.bounds;
    }
    const Bounds bounds = fitMesh(*mesh);
    const std::unique_lock<thread::ForkAwareMutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock()) return bounds;
    if (bounds_.size() >= most_) {
      for (auto i = bounds_.begin(); i != bounds_.end();)
        i = i->second.mesh.expired() ? bounds_.erase(i) : std::next(i);
      most_ = std::max(kLeast, 2 * bounds_.size());
    }
    bounds_.insert_or_assign(mesh.get(), Known{mesh, bounds});
    return bounds;
  }

 private:
  struct Known {
    std::weak_ptr<const Mesh> mesh;
    Bounds bounds;
  };
  static constexpr std::size_t kLeast = 64;

  thread::ForkAwareMutex mutex_;
  std::unordered_map<const Mesh*, Known> bounds_;
  std::size_t most_ = kLeast;  // then what is gone is forgotten
};

template <typename S>
Bounds boundsOfModel(const Model<S>& model) {
  const tree::Tree& tree = fcl_adapter::treeOf(model);
  // Other threads may change the vertices meanwhile.
  const std::shared_lock<thread::ShardedLock> lock(tree.queryLock());
  const std::shared_ptr<const Mesh>& mesh = tree.surface().mesh;
  Bounds b;
  if (mesh != nullptr) {
    // Never destroyed: scenes of static objects may still ask.
    static MeshBounds& known = *new MeshBounds;
    b = known.of(mesh);
  } else {
    const Eigen::AlignedBox3d& box = tree.surface().bounds;
    b.center = box.center();
    b.half = box.sizes() / 2;
  }
  const Options& o = model.options();
  b.reach = o.margin;
  if (o.answer == Answer::kConservative) {
    b.reach += 1.001 * tree.sphereReach() + 1e-12 * (b.half.norm() + b.center.norm());
  }
  return b;
}

#if FCL_HAVE_OCTOMAP
// Extends a box by the occupied cells below a node. Cubes that stick out of it by little are not looked at closely: a
// map may have a million cells, and each change of it asks for its bounds.
template <typename S>
void extendByCells(const fcl_adapter::OcTreeSide<S>& tree, const typename fcl_adapter::OcTreeSide<S>::Node& node,
                   Eigen::AlignedBox3d& box) {
  constexpr double kCoarse = 32;  // each face of the box is too far out by at most this part of its length
  Eigen::Vector3d center;
  const double half = tree.octantsOf(node, center);
  const Eigen::AlignedBox3d cube(center.array() - half, center.array() + half);
  if (box.contains(cube)) return;
  const bool is_leaf = tree.state(node) == query::State::kLeaf;
  if (is_leaf ? tree.occupied(node) : 2 * half * kCoarse <= box.sizes().maxCoeff()) {
    box.extend(cube);
  } else if (!is_leaf) {
    tree.children(node, [&](const auto& child) { extendByCells(tree, child, box); });
  }
}

// Of cells that are occupied; no other makes a contact.
template <typename S>
Bounds boundsOfOcTree(const fcl::OcTree<S>& octree) {
  const fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  const fcl_adapter::OcTreeSide<S> tree(octree, X, S(1), false);
  Eigen::AlignedBox3d box;
  if (!tree.empty()) extendByCells(tree, tree.root(), box);
  Bounds b;
  if (box.isEmpty()) {
    b.kind = Bounds::kNowhere;
  } else {
    b.center = box.center();
    // FCL halves boxes in S all the way from the root.
    b.half = box.sizes().array() / 2 +
             32 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (b.center.norm() + box.sizes().norm());
  }
  return b;
}
#endif

template <typename S>
Bounds boundsOfShape(const fcl::ShapeBase<S>& shape) {
  Bounds b;
  const fcl::NODE_TYPE type = shape.getNodeType();
  if (type == fcl::GEOM_PLANE || type == fcl::GEOM_HALFSPACE) {
    b.kind = Bounds::kEverywhere;
    return b;
  }
  // Not computeLocalAABB(): other threads may read the shape's box.
  return aligned(fcl_adapter::withShape(shape, [](const auto& s) {
    fcl::AABB<S> box;
    fcl::computeBV(s, fcl::Transform3<S>(fcl::Transform3<S>::Identity()), box);
    return box;
  }));
}

}  // namespace

template <typename S>
Bounds boundsOf(const fcl::CollisionGeometry<S>& geometry) {
  Bounds b;
  if (const Model<S>* model = fcl_adapter::asModel<S>(&geometry)) {
    b = boundsOfModel(*model);
  } else {
#if FCL_HAVE_OCTOMAP
    const bool is_octree = geometry.getNodeType() == fcl::GEOM_OCTREE;
    b = is_octree ? boundsOfOcTree(static_cast<const fcl::OcTree<S>&>(geometry))
                  : boundsOfShape(static_cast<const fcl::ShapeBase<S>&>(geometry));
#else
    b = boundsOfShape(static_cast<const fcl::ShapeBase<S>&>(geometry));
#endif
    b.reach = kSolverReach * (1 + b.half.norm());
  }
  b.radius = b.half.norm();
  b.size = b.radius + b.center.norm();
  b.width = 2 * b.half.minCoeff();
  // Beyond this, single precision has no room for the squares.
  if (b.kind == Bounds::kBox && !(b.size < kUnboxedSize)) b.kind = Bounds::kEverywhere;
  return b;
}

template Bounds boundsOf<float>(const fcl::CollisionGeometry<float>&);
template Bounds boundsOf<double>(const fcl::CollisionGeometry<double>&);

}  // namespace bocst::scene
