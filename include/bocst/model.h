// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>
#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>
#include <bocst/oracle.h>
#include <bocst/statistics.h>
#include <fcl/geometry/bvh/BVH_internal.h>
#include <fcl/geometry/collision_geometry.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace fcl {
template <typename BV>
class BVHModel;
}

namespace bocst {

namespace tree {
class Tree;
}
namespace fcl_adapter {
struct ModelTree;
}

/// A Branch On-collide Sphere-tree as an FCL geometry: one sphere at first, grown by the queries that touch it
/// (Rodríguez and Franquesa, section 3).
///
/// Threads: any number of threads may query one model, read its statistics, visit() and prune() it at the same time.
/// updateVertices() may run beside queries too; a query sees the mesh from before or after, never a mixture. What
/// CollisionGeometry itself leaves unguarded (cost_density, aabb_local, ...) stays unguarded.
///
/// After fork() a child may use the models that it makes itself, and those of the parent that no other thread was using
/// at the fork (with a GPU, on the CPU). Of a model that another thread was using, what needs to wait for that thread
/// or would change what it may have left half done throws std::runtime_error: a query while the tree was being grown or
/// pruned, and prune(), expandAll(), updateVertices(). Nothing waits for a thread that is not there.
///
/// The mesh is a surface, as FCL's BVHModel is: what is wholly inside it does not touch it (but see Options::solid).
template <typename S>
class BOCST_EXPORT Model : public fcl::CollisionGeometry<S> {
 public:
  /// @throws std::invalid_argument for a null mesh, an option out of range, or a mesh that is not watertight if solid,
  /// OracleError for an oracle that cannot be had, std::runtime_error when code compiled without <bocst/fcl.h> would
  /// not reach this library (the message has the remedy; BOCST_DISPATCH_CHECK=off turns the check off).
  explicit Model(std::shared_ptr<const Mesh> mesh, const Options& options = {});

  /// Takes the vertices and triangles of an FCL mesh, not its tree, which need not be built: addSubModel() without
  /// endModel() will do. BV::S must be S. Of an empty BVHModel the model is empty, too.
  template <typename BV>
  explicit Model(const fcl::BVHModel<BV>& bvh, const Options& options = {}) : Model(options) {
    if (bvh.num_tris > 0 || bvh.num_vertices > 0) setMesh(meshOf(bvh));
  }

  /// An empty model: nothing touches it, and it is at no distance from anything, as an empty fcl::BVHModel. A mesh
  /// comes by setMesh(), or by FCL's names from beginModel() on. A Scene takes no empty model.
  Model() : Model(Options{}) {}
  explicit Model(const Options& options);  ///< An empty model with options.

  ~Model() override;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  /// Has it no mesh yet? @throws std::logic_error between beginModel() and endModel(), as queries do.
  bool empty() const;

  /// Another mesh; the tree is one sphere again. Not beside queries. What throws is as for the constructor, and the
  /// model is then as before.
  void setMesh(std::shared_ptr<const Mesh> mesh);

  // FCL's names, for code that was written for fcl::BVHModel. They return fcl::BVH_OK, or as there the code of what was
  // called out of sequence. endModel() builds no tree; without any triangle it returns fcl::BVH_ERR_BUILD_EMPTY_MODEL
  // and the model stays empty; what Mesh() refuses throws std::invalid_argument. Not beside queries.
  int beginModel(int num_tris = 0, int num_vertices = 0);  ///< Drops the mesh that is there.
  int addVertex(const fcl::Vector3<S>& p);                 ///< In the mesh's frame.
  /// Adds three vertices and the triangle between them.
  int addTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3);
  /// Adds vertices and triangles, whose indices count from the first of these vertices.
  int addSubModel(const std::vector<fcl::Vector3<S>>& ps, const std::vector<fcl::Triangle>& ts);
  int addSubModel(const std::vector<fcl::Vector3<S>>& ps);  ///< Adds vertices only.
  int endModel();                                           ///< Takes what was added as the mesh.

  // New positions in the order of the vertices, then updateVertices(). Fewer or more than there are vertices:
  // fcl::BVH_ERR_INCORRECT_DATA, and the model is as before. There is no tree to refit, so the arguments do not matter.
  int beginReplaceModel() { return beginUpdateModel(); }                   ///< As beginUpdateModel().
  int replaceVertex(const fcl::Vector3<S>& p) { return updateVertex(p); }  ///< As updateVertex().
  /// As updateTriangle().
  int replaceTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3) {
    return updateTriangle(p1, p2, p3);
  }
  int replaceSubModel(const std::vector<fcl::Vector3<S>>& ps) { return updateSubModel(ps); }  ///< As updateSubModel().
  /// As endUpdateModel().
  int endReplaceModel(bool refit = true, bool bottomup = true) { return endUpdateModel(refit, bottomup); }
  int beginUpdateModel();                      ///< Begins with the first vertex.
  int updateVertex(const fcl::Vector3<S>& p);  ///< Where the next vertex is, in the mesh's frame.
  /// Where the next three vertices are.
  int updateTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3);
  int updateSubModel(const std::vector<fcl::Vector3<S>>& ps);   ///< Where the next vertices are.
  int endUpdateModel(bool refit = true, bool bottomup = true);  ///< Takes the new positions.

  /// fcl::BVH_MODEL_TRIANGLES; of an empty model fcl::BVH_MODEL_UNKNOWN.
  fcl::BVHModelType getModelType() const;

  const Options& options() const;  ///< As given.

  /// The mesh as it is now. Keeps it alive across updateVertices(). Null after releaseMesh(), and
  /// while the model is empty.
  std::shared_ptr<const Mesh> mesh() const;

  /// Lets go of the mesh in host memory; the compute oracle has it on its device (3: "the model need not be in core
  /// memory"). It goes when nobody else holds it. From then on a query throws OracleError if the device is lost.
  /// @throws std::logic_error for exact answers and for solids, which look at the triangles here; OracleError when the
  /// oracle of this model has no copy.
  void releaseMesh();

  /// "cpu", "occlusion", "sampled", "compute", or "cpu and compute" (kAuto where there is a GPU).
  std::string oracleName() const;

  Statistics statistics() const;  ///< A snapshot.

  /// Makes the complete tree down to level `depth` resident (1 to 17), as the paper's tables count it; branches that
  /// queries have grown deeper are dropped first. For inspection: queries never need it.
  void expandAll(int depth);

  /// Calls f for every resident node, parents before children. f must not call back into this model.
  void visit(const std::function<void(const NodeView&)>& f) const;

  /// Applies ttl and memory budget as of `now` (3.1): drops each deepest branch level whose last use is longer ago
  /// than ttl; its parent's own time starts then. Queries do the same by themselves, now and then.
  void prune(Clock::time_point now);
  void prune();  ///< As of now.

  /// New positions for all vertices, same triangles: the tree falls back to its root, nothing is rebuilt.
  /// @throws std::invalid_argument for a wrong count, a bad vertex, or what is not watertight if solid,
  /// std::logic_error after releaseMesh(); the model is then as before.
  void updateVertices(std::vector<Eigen::Vector3d> vertices);

  /// What the surface encloses, by the sums over its triangles that fcl::BVHModel makes: the volume (negative where the
  /// surface is turned inside out), its centre of mass, and the moments of inertia about the mesh's origin for the
  /// density 1. For a surface that is not closed, the numbers of FCL, which depend on where the origin is.
  /// @throws std::logic_error after releaseMesh().
  S computeVolume() const override;
  fcl::Vector3<S> computeCOM() const override;              ///< See computeVolume(); NaN without a volume.
  fcl::Matrix3<S> computeMomentofInertia() const override;  ///< See computeVolume().

  // What FCL asks of a geometry.
  void computeLocalAABB() override;                 ///< The mesh's bounds, and the sphere about their middle
                                                    ///< that holds all vertices; these are looked through once.
  fcl::OBJECT_TYPE getObjectType() const override;  ///< OT_UNKNOWN: FCL never swaps the arguments.
  fcl::NODE_TYPE getNodeType() const override;      ///< GEOM_TRIANGLE: a slot FCL leaves empty.

 private:
  friend struct fcl_adapter::ModelTree;

  template <typename BV>
  static std::shared_ptr<const Mesh> meshOf(const fcl::BVHModel<BV>& bvh) {
    static_assert(std::is_same<typename BV::S, S>::value, "the scalar of the BVHModel must be the model's");
    std::vector<Eigen::Vector3d> vertices(bvh.num_vertices > 0 ? bvh.num_vertices : 0);
    for (std::size_t i = 0; i < vertices.size(); ++i) vertices[i] = bvh.vertices[i].template cast<double>();
    std::vector<fcl::Triangle> triangles(bvh.tri_indices, bvh.tri_indices + (bvh.num_tris > 0 ? bvh.num_tris : 0));
    return std::make_shared<const Mesh>(std::move(vertices), triangles);
  }

  struct Staged;  // What comes by FCL's names before the mesh is made of it.
  Options options_;
  std::unique_ptr<Staged> staged_;  // Between begin and end.
  std::unique_ptr<tree::Tree> tree_;
};

using Modelf = Model<float>;
using Modeld = Model<double>;

extern template class Model<float>;
extern template class Model<double>;

}  // namespace bocst
