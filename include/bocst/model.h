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

/// A triangle mesh as an FCL geometry, with a Branch On-collide Sphere-tree (Rodríguez and Franquesa, section 3). The
/// tree starts as one sphere; queries expand the nodes that they touch.
///
/// Threads: any number of threads may query one model, read its statistics, visit() and prune() it at the same time.
/// One thread at a time may call updateVertices() meanwhile; a query sees the mesh before or after the update, never a
/// mixture.
/// expandAll() and releaseMesh() may be called at the same time, and wait for running queries. No query may run during
/// setMesh(). A query that begins between beginModel() and endModel() throws std::logic_error; none may run while one
/// of these two runs.
/// The public members of CollisionGeometry (cost_density, aabb_local, ...) are not protected, as in FCL.
///
/// After fork() a child process may use models that it makes itself, and models of the parent that no other thread was
/// using at the fork (models on a GPU then use the CPU). For a model that another thread was using, these calls throw
/// std::runtime_error: prune(), expandAll(), updateVertices(), and a query if that thread was expanding or pruning the
/// tree. No call waits for a thread that does not exist in the child.
///
/// The mesh is a surface, as in FCL's BVHModel: a geometry inside it does not touch it (but see Options::solid).
template <typename S>
class BOCST_EXPORT Model : public fcl::CollisionGeometry<S> {
 public:
  /// @throws std::invalid_argument for a null mesh, an option out of range, or with Options::solid a mesh that is not
  /// watertight; OracleError if the oracle is not available; std::runtime_error if code compiled without <bocst/fcl.h>
  /// would not reach this library (the message says how to fix it; BOCST_DISPATCH_CHECK=off turns the check off).
  /// Logs a warning for a mesh so far from its origin that S holds no details of it; see setLogger().
  explicit Model(std::shared_ptr<const Mesh> mesh, const Options& options = {});

  /// Copies the vertices and triangles of an FCL mesh. FCL's tree is not used and need not be built: addSubModel()
  /// without endModel() is enough. BV::S must be S. From an empty BVHModel, the model is empty, too. Throws as the
  /// constructor above, and std::invalid_argument for a mesh that Mesh refuses.
  template <typename BV>
  explicit Model(const fcl::BVHModel<BV>& bvh, const Options& options = {}) : Model(options) {
    if (bvh.num_tris > 0 || bvh.num_vertices > 0) setMesh(meshOf(bvh));
  }

  /// An empty model: it collides with nothing and has no distance to any geometry, as an empty fcl::BVHModel. Its mesh
  /// is set by setMesh(), or by FCL's functions from beginModel() on. A Scene does not accept an empty model.
  /// @throws std::runtime_error as above.
  Model() : Model(Options{}) {}
  /// An empty model with these options.
  /// @throws std::invalid_argument for an option out of range; std::runtime_error as above.
  explicit Model(const Options& options);

  ~Model() override;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  /// True if the model has no mesh. @throws std::logic_error between beginModel() and endModel(), as queries do.
  bool empty() const;

  /// Replaces the mesh; the tree is one sphere again. No query may run at the same time. Throws as the constructor
  /// does; the model is then unchanged.
  void setMesh(std::shared_ptr<const Mesh> mesh);

  // FCL's functions, for code that was written for fcl::BVHModel. They return fcl::BVH_OK, or FCL's code for a call out
  // of sequence. endModel() builds no tree. If nothing was added, it returns fcl::BVH_ERR_BUILD_EMPTY_MODEL and the
  // model stays empty. It throws as Mesh() and setMesh() do, and the model is then empty. No query may run at the same
  // time.
  int beginModel(int num_tris = 0, int num_vertices = 0);  ///< Drops the mesh that is there.
  int addVertex(const fcl::Vector3<S>& p);                 ///< In the mesh's frame.
  /// Adds three vertices and the triangle between them.
  int addTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3);
  /// Adds vertices and triangles, whose indices count from the first of these vertices.
  int addSubModel(const std::vector<fcl::Vector3<S>>& ps, const std::vector<fcl::Triangle>& ts);
  int addSubModel(const std::vector<fcl::Vector3<S>>& ps);  ///< Adds vertices only.

  /// Takes what was added as the mesh. Without beginModel(), or if nothing was added, it logs an error (see
  /// setLogger()).
  int endModel();

  // New positions in the order of the vertices, as updateVertices(). Another number of positions than of vertices gives
  // fcl::BVH_ERR_INCORRECT_DATA, a message to the logger and an unchanged model. The arguments have no effect: there is
  // no tree to refit.
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
  int updateVertex(const fcl::Vector3<S>& p);  ///< Position of the next vertex, in the mesh's frame.
  /// Positions of the next three vertices.
  int updateTriangle(const fcl::Vector3<S>& p1, const fcl::Vector3<S>& p2, const fcl::Vector3<S>& p3);
  int updateSubModel(const std::vector<fcl::Vector3<S>>& ps);   ///< Positions of the next vertices.
  int endUpdateModel(bool refit = true, bool bottomup = true);  ///< Takes the new positions.

  /// fcl::BVH_MODEL_TRIANGLES; for an empty model fcl::BVH_MODEL_UNKNOWN.
  fcl::BVHModelType getModelType() const;

  const Options& options() const;  ///< As given to the constructor.

  /// The current mesh. The pointer keeps it alive also after updateVertices(). Null after releaseMesh(), and while the
  /// model is empty.
  std::shared_ptr<const Mesh> mesh() const;

  /// Releases the mesh in host memory (paper, 3: "the model need not be in core memory"); the oracle's device keeps a
  /// copy. The memory is freed when no other owner is left. Conservative answers of the compute oracle need the mesh on
  /// its device only. For exact answers, and for the occlusion oracles, a query that is not decided by boxes reads the
  /// mesh back; prune() frees it again once the tree is a single sphere and ttl has passed. Such queries throw
  /// OracleError if the device lost the mesh.
  /// @throws std::logic_error for an empty model, and for solids, which need the triangles in host memory; OracleError
  /// if the oracle of this model has no device (OracleKind::kCpu; kAuto, unless BOCST_ORACLE names an oracle on a
  /// device). The model is then unchanged.
  void releaseMesh();

  /// "cpu", "occlusion", "sampled", "compute", or "cpu and compute" (kAuto where there is a GPU).
  /// @throws std::logic_error for an empty model.
  std::string oracleName() const;

  Statistics statistics() const;  ///< A snapshot.

  /// Builds the whole tree of exact answers now, in 60 to 150 ns per triangle (the first build of a process up to 450),
  /// so that the next queries do not have to. For a program with a set-up, or whose queries have a time limit. Set
  /// Options::ttl to 0 to keep the tree: otherwise branches that no query uses for ttl are dropped, also while other
  /// queries run. A memory_budget still holds: what exceeds it is dropped again. Not built are oriented boxes, which
  /// queries of flat parts at rest on each other need (1.2 to 4 us per triangle), and probes, which prove deep contact
  /// in collidePoses() and Scene (90 ns per triangle): the query that has paid for them builds them, or, with
  /// Options::build_ahead, a thread. Conservative answers gain nothing by buildTree(), nor do models with an
  /// oracle on a device. Does nothing if the tree is complete, or for more than 178 million triangles. Queries may run
  /// at the same time; those that have to grow the tree wait.
  /// @throws std::logic_error for an empty model; std::bad_alloc, which leaves the tree as valid as it was.
  void buildTree();

  /// Expands the complete tree down to level `depth` (1 to 17; the root is level 1, as in the paper's tables). Deeper
  /// branches, grown by queries, are dropped first. For inspection; queries never need it, and with exact answers they
  /// may replace these nodes by their own. Options::memory_budget holds again when a query has walked the tree.
  /// @throws std::invalid_argument for another depth; std::logic_error for an empty model.
  void expandAll(int depth);

  /// Calls f for every resident node, parents before children. f must not call back into this model.
  void visit(const std::function<void(const NodeView&)>& f) const;

  /// Applies ttl and memory_budget at the time `now` (paper, 3.1). Removes the deepest nodes that were last used more
  /// than ttl ago; at that moment the ttl of their parents starts anew. So a branch goes level by level. Queries also
  /// do this from time to time, if it is worth the work. If a query used the model within the last ttl, they keep
  /// the nodes of a whole build, and drop only the copies of triangle corners in unused leaves.
  void prune(Clock::time_point now);
  void prune();  ///< With the current time.

  /// Sets new positions of all vertices; the triangles stay. The tree is reset to its root, nothing is rebuilt: later
  /// queries grow it again. Where these have a time limit, make a new model instead, see share/doc/from-bvhmodel.md.
  /// @throws std::invalid_argument for a wrong number of vertices, a bad vertex, or with Options::solid a mesh that is
  /// not watertight; std::logic_error for an empty model or after releaseMesh(). The model is then unchanged.
  void updateVertices(std::vector<Eigen::Vector3d> vertices);

  /// Volume inside the surface (negative if the surface is inside out), its centre of mass, and its moments of inertia
  /// about the mesh's origin for density 1, by the same sums over triangles as fcl::BVHModel. For a surface that is not
  /// closed, the values are those of FCL and depend on the position of the origin.
  /// @throws std::logic_error after releaseMesh() and for an empty model.
  S computeVolume() const override;
  fcl::Vector3<S> computeCOM() const override;              ///< See computeVolume(); NaN without a volume.
  fcl::Matrix3<S> computeMomentofInertia() const override;  ///< See computeVolume().

  // FCL's interface of a geometry.
  /// Sets aabb_local to the mesh's bounds, enlarged by Options::margin, and aabb_center and aabb_radius to the sphere
  /// about the box's centre around all vertices (searched only once for each mesh). Constructors, setMesh() and
  /// updateVertices() set them, too, but aabb_radius to the sphere around the whole box, which is found at once. As
  /// with fcl::BVHModel, fcl::CollisionObject's constructor calls this. The spheres of conservative answers reach
  /// beyond this box, so a broadphase manager leaves out pairs that touch by these alone.
  void computeLocalAABB() override;
  fcl::OBJECT_TYPE getObjectType() const override;  ///< OT_UNKNOWN: FCL never swaps the arguments.
  fcl::NODE_TYPE getNodeType() const override;      ///< GEOM_TRIANGLE: an empty row of FCL's tables.

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

  struct Staged;  // What FCL's functions have added before the mesh is made of it.
  Options options_;
  std::unique_ptr<Staged> staged_;  // Between begin and end.
  std::unique_ptr<tree::Tree> tree_;
};

using Modelf = Model<float>;
using Modeld = Model<double>;

extern template class Model<float>;
extern template class Model<double>;

}  // namespace bocst
