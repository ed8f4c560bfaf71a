// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>
#include <bocst/statistics.h>
#include <fcl/math/triangle.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace bocst::program {

enum class Scalar { kFloat, kDouble };

/// A mesh as a caller of FCL has it, so that both sides start from the same arrays.
struct MeshArrays {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<fcl::Triangle> triangles;

  /// With float, vertices are rounded here, once: both sides must see the same mesh.
  MeshArrays(const Mesh& mesh, Scalar scalar);
};

/// Two geometries A and B, and questions about them. X_AB is the pose of B in A's frame.
class QueryPair {
 public:
  /// Ids of A and of B, as in fcl::Contact: triangles, or with conservative answers Morton codes of cells.
  using Contact = std::pair<std::int64_t, std::int64_t>;
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  enum class Order { kAB, kBA };

  QueryPair() = default;
  virtual ~QueryPair() = default;
  QueryPair(const QueryPair&) = delete;
  QueryPair& operator=(const QueryPair&) = delete;

  /// fcl::collide in its default form: true if they touch. Order says which geometry is the first argument.
  virtual bool touch(const Eigen::Isometry3d& X_AB, Order order = Order::kAB) const = 0;

  /// Up to `limit` contacts as found, sorted and without repetitions.
  virtual std::vector<Contact> contacts(const Eigen::Isometry3d& X_AB, std::size_t limit = kAll,
                                        Order order = Order::kAB) const = 0;

  /// All contacts with their geometry, as the query itself counts them.
  virtual std::size_t countContacts(const Eigen::Isometry3d& X_AB) const = 0;

  /// fcl::distance in its default form.
  virtual double distance(const Eigen::Isometry3d& X_AB) const = 0;
};

/// FCL's own trees over both meshes.
enum class FclTree { kObbRss, kObb, kRss };

class FclPair : public QueryPair {
 public:
  /// FCL's triangle test alone, as its query would make it had its trees not culled the pair before.
  virtual bool trianglesTouch(Contact triangles, const Eigen::Isometry3d& X_AB, Order order) const = 0;

  /// What a refitted box of FCL's is about.
  enum class Refit {
    kNewPositions,   ///< Its triangles where they are now: endReplaceModel.
    kBothPositions,  ///< Where they are and where they were before: endUpdateModel.
  };

  /// A's vertices move, and its tree is built anew.
  virtual void rebuildA(const MeshArrays& mesh) = 0;

  /// A's vertices move, and its tree keeps its shape. One pair takes one kind of refit only.
  virtual void refitA(const std::vector<Eigen::Vector3d>& vertices, Refit refit) = 0;
};

std::unique_ptr<FclPair> buildFclPair(FclTree tree, Scalar scalar, const MeshArrays& a, const MeshArrays& b);

/// Bytes of the bounding volume nodes that FCL's OBBRSS tree takes for this many triangles.
std::size_t fclTreeBytes(Scalar scalar, std::size_t triangles);

/// Where two geometries touch, in A's frame.
struct TouchingPoint {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  ///< A unit vector from A to B.
  double depth = 0;        ///< In the meshes' length unit.
  QueryPair::Contact triangles{-1, -1};
};

/// What of two geometries that do not touch is nearest, in A's frame.
struct NearestPoints {
  double distance = 0;  ///< In the meshes' length unit.
  Eigen::Vector3d on_a, on_b;
  QueryPair::Contact triangles{-1, -1};
};

/// Two fresh bocst models.
class BocstPair : public QueryPair {
 public:
  /// As contacts(), in the order found, by their geometry.
  virtual std::vector<TouchingPoint> touchingPoints(const Eigen::Isometry3d& X_AB, std::size_t limit = kAll) const = 0;

  virtual NearestPoints nearest(const Eigen::Isometry3d& X_AB) const = 0;

  /// Model::buildTree() of both.
  virtual void buildTrees() = 0;

  /// A's vertices move.
  virtual void updateA(std::vector<Eigen::Vector3d> vertices) = 0;

  /// What is resident, parents before children.
  virtual std::vector<NodeView> nodesA() const = 0;
  virtual std::vector<NodeView> nodesB() const = 0;

  virtual Statistics statisticsA() const = 0;
  virtual Statistics statisticsB() const = 0;
  virtual std::string oracleName() const = 0;

  std::size_t nodes() const { return statisticsA().resident_nodes + statisticsB().resident_nodes; }
  std::size_t bytes() const { return statisticsA().resident_bytes + statisticsB().resident_bytes; }
};

std::unique_ptr<BocstPair> makeBocstPair(Scalar scalar, const MeshArrays& a, const MeshArrays& b,
                                         const Options& options);

/// Vertices and 32-bit indices, to be handed over.
struct HandedOver {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> triangles;

  explicit HandedOver(const Mesh& mesh) : vertices(mesh.vertices()), triangles(mesh.triangles()) {}
};

/// The same, in double, of arrays that nobody else needs.
std::unique_ptr<BocstPair> makeBocstPair(HandedOver&& a, HandedOver&& b, const Options& options);

}  // namespace bocst::program
