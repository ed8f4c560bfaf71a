// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/node_view.h>
#include <bocst/options.h>
#include <bocst/statistics.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <vector>

#include "mesh/interior.h"
#include "mesh/solid.h"
#include "oracle/oracle.h"
#include "thread/published.h"
#include "thread/sharded_lock.h"
#include "tree/node_store.h"
#include "tree/on_demand.h"
#include "tree/outline.h"
#include "tree/root_grid.h"
#include "tree/support_table.h"

namespace bocst::oracle {
class StoredMesh;
}

namespace bocst::tree {

class BoxTree;
class BulkBuilder;

/// @throws std::invalid_argument for options out of range.
void checkOptions(const Options& options);

/// The sphere-tree of one model: resident nodes, how they grow and how they are dropped.
///
/// Threads: a query holds the query lock shared while it looks at nodes. Growth appends blocks and publishes each by
/// one store of its child reference, so readers are never in its way; one growth a tree at a time. What removes nodes
/// (pruning, new vertices) holds the query lock alone. While the query lock is held shared, child references only go
/// implicit -> list -> block, with two exceptions: a list may become the same list with packed corners, and the root's
/// block may become that of the whole tree. So read a reference once.
class Tree {
 public:
  /// @throws std::invalid_argument for options out of range, OracleError.
  Tree(std::shared_ptr<const Mesh> mesh, const Options& options);
  ~Tree();

  const Options& options() const { return options_; }
  oracle::Oracle& oracle() const { return *oracle_; }
  thread::ShardedLock& queryLock() const { return query_lock_; }

  /// A box about the surface, or about the spheres of conservative answers; without a lock.
  const Outline& outline() const { return outline_; }
  /// True if it is time for a query to look for branches to drop. Without a lock.
  bool isPruneDue(std::int64_t now) const { return now >= next_prune_.load(std::memory_order_relaxed); }
  /// True if something is resident that is dropped some time if no query uses it. Without a lock.
  bool hasDecay() const {
    return (root_.load(std::memory_order_relaxed).tag() == ChildRef::kBlock || boxes_.seen() != nullptr ||
            interior_.seen() != nullptr || recalled_bytes_.load(std::memory_order_relaxed) != 0) &&
           next_prune_.load(std::memory_order_relaxed) != kNeverDue;
  }

  // While the query lock is held, shared or alone.

  const oracle::Surface& surface() const { return surface_; }
  /// Queries with exact answers need a mesh that was released: recallMesh() brings it back.
  bool lacksMesh() const { return surface_.mesh == nullptr && !conservative(); }
  /// How far the spheres of conservative answers reach beyond the surface at most, in model units; 0 for exact answers.
  /// A sphere is about a cell of the collision depth that the surface meets, so no point of it is farther from the
  /// surface than the cell's diagonal. (Cells are decided to less than a lattice unit, which is added.)
  double sphereReach() const;
  /// About all that queries may meet, in the mesh's frame: the surface, or the spheres. No sphere reaches farther
  /// beyond its cell's region than 2^-1/2 of a cell's side along an axis: to that where the region is flat, else to
  /// less.
  Eigen::AlignedBox3d queryBox() const;

  ChildRef childRef(NodeRef node) const {
    return node.isRoot() ? root_.load(std::memory_order_acquire)
                         : nodes_.blocks[node.block()].child[node.octant()].load(std::memory_order_acquire);
  }
  const Block& block(std::uint32_t index) const { return nodes_.blocks[index]; }
  /// True for a lane of a loose block. Other nodes are cells.
  bool isLoose(NodeRef node) const { return !node.isRoot() && nodes_.blocks[node.block()].isLoose(); }
  /// The root's is 1; that of a lane is the level of a cell of about its size.
  int level(NodeRef node) const { return node.isRoot() ? 1 : nodes_.blocks[node.block()].childLevel(); }
  /// For nodes that are no lanes.
  lattice::Cell cell(NodeRef node) const {
    return node.isRoot() ? lattice::Cell{} : nodes_.blocks[node.block()].cell().octant(node.octant());
  }
  /// Box and slab of the root; those of other nodes are in their parents' blocks.
  const bounds::NodeBounds& rootBounds() const { return nodes_.root_bounds; }
  TriangleList list(ChildRef ref) const { return nodes_.lists[ref.index()]; }
  const TriangleLists& lists() const { return nodes_.lists; }
  /// How far the surface reaches in any direction: as far as its box, or exactly once the whole tree was built.
  const SupportTable& supports() const { return supports_; }
  /// Adds work that a whole tree would have saved, in triangles grown by parts. Once the sum exceeds the price of a
  /// whole tree, the next query builds it. One walk in a tree that is not whole adds kWalkRent.
  static constexpr std::size_t kWalkRent = 64;
  void payRent(std::size_t triangles) const { rent_.pay(triangles); }
  /// Builds the whole tree when queries have paid as much as that costs, unless another thread grows it; true if built.
  /// Of a model that is built ahead, the first query that has paid anything has the helper thread do it.
  bool buildIfDue() { return rent_.isDue() && buildNow(); }
  /// Builds the whole tree of exact answers, whatever queries have paid; only of a tree that gains by it, in a query.
  void build();
  bool gainsByBuild() const;
  /// All blocks of the whole tree are there. They stay while a query runs.
  bool isComplete() const { return is_complete_.load(std::memory_order_acquire); }
  /// A request for few contacts may build the whole tree: not where that takes long, is often repeated, is for the
  /// helper thread to do, or has no room.
  bool isBuiltForFew() const {
    constexpr std::size_t kMostTriangles = 1 << 18;
    return gainsByBuild() && options_.memory_budget == 0 && !options_.build_ahead &&
           surface_.triangle_count <= kMostTriangles && !has_changed_;
  }
  /// No more expansions below this node: a single lattice unit, or the collision depth of conservative answers.
  bool isDeepest(int level) const { return level >= deepest_; }
  int deepest() const { return deepest_; }
  bool conservative() const { return options_.answer == Answer::kConservative; }

  /// What the mesh encloses, for a model that is solid; else null.
  const Solid* solid() const { return solid_.get(); }
  /// A point of each connected component of the surface, in the mesh's frame; found when first asked for.
  const std::vector<Eigen::Vector3d>& componentPoints() const;
  /// Oriented boxes of all triangles in double, for exact answers where the boxes of blocks separate too little: they
  /// are as thin as the surface. Built when first asked for, and dropped like a branch. @throws std::bad_alloc.
  const BoxTree& boxes(std::int64_t now);
  /// Builds them, or leaves that to the helper thread (Options::build_ahead). False while there are none, and where
  /// there is no memory for them: then walks must pay for them again.
  bool buildBoxes(std::int64_t now);
  /// Null unless they are built.
  const BoxTree* knownBoxes() const { return boxes_.seen(); }
  /// They would not take most of the memory budget.
  bool affordsBoxes() const;
  /// How many steps (see Turns) long walks still take before boxes() pays; 0 if it is built, or the helper thread was
  /// asked for it.
  std::size_t boxPrice() const { return knownBoxes() != nullptr || boxes_.isAwaited() ? 0 : boxes_.rent.left(); }
  /// Adds steps that a long walk has taken.
  void payBoxRent(std::size_t steps) const { boxes_.rent.pay(steps); }

  /// The surface's Interior, which proves contact quickly; null until payInterior() has built it. Dropped like a
  /// branch.
  const Interior* interior(std::int64_t now) const {
    const Interior* known = interior_.seen();
    if (known != nullptr) interior_.markUsed(now);
    return known;
  }
  /// A walk has found that the surface touches another one. Builds interior(), or has the helper thread do it, once
  /// such walks have taken about twice as long as that does, if there is memory.
  void payInterior(std::int64_t now);

  /// How the last long search of a kind ended: over oriented boxes or over blocks, so many times in a row, and after
  /// how many steps. A guess for the next one.
  enum class Search { kYesOrNo, kContacts, kDistance, kContactTime };
  struct LongSearch {
    std::uint32_t over_boxes : 1, times : 31;  ///< times: 0 before the first.
    std::uint32_t steps;
  };
  LongSearch longSearch(Search kind) const { return long_searches_[static_cast<std::size_t>(kind)]; }
  void setLongSearch(Search kind, LongSearch last) const { long_searches_[static_cast<std::size_t>(kind)] = last; }

  /// Marks a block as used now, for ttl and budget.
  void markUsed(std::uint32_t block, std::int64_t now) const { markUsedAt(nodes_.last_use[block], now); }
  /// A block is about to be marked.
  void prefetchLastUse(std::uint32_t block) const { __builtin_prefetch(&nodes_.last_use[block]); }
  std::int64_t now() const;

  /// The root grid knows the children of this frontier node.
  bool growsFromGrid(NodeRef node) const {
    const RootGrid* grid = grid_.seen();
    return grid != nullptr && !isLoose(node) && level(node) < grid->level();
  }

  /// The resident nodes where the oracle works, for a walk there; `nodes` is null where it takes none.
  struct NodeTable {
    std::shared_ptr<const oracle::DeviceResource> nodes;
    std::uint32_t blocks = 0, root = oracle::node_table::kNone;
  };
  NodeTable nodeTable();

  /// A node to grow, and whether a list of at most kMaxLeafTriangles is enough (exact answers).
  struct Growth {
    Tree* tree;
    NodeRef node;
    bool list_suffices;
  };

  /// One expansion batch: makes each node's children resident (or, where enough, its list). A node may occur more than
  /// once; nodes that another thread has grown meanwhile are skipped. The query locks of all trees are held shared.
  static void grow(const std::vector<Growth>& nodes);

  /// The same in two steps: oracles work on it until finish(), and meanwhile this thread may walk over what is
  /// resident, but not grow more. It holds the trees' growth mutexes.
  class Batch {
   public:
    explicit Batch(const std::vector<Growth>& nodes);
    ~Batch() { abandon(); }
    Batch(const Batch&) = delete;
    Batch& operator=(const Batch&) = delete;

    /// Waits for the answers and publishes them. @throws OracleError.
    void finish();

   private:
    struct Part {
      oracle::Oracle* oracle;
      std::vector<Growth> nodes;
      std::vector<oracle::ExpansionRequest> requests;
    };
    void lockTrees(const std::vector<Growth>& nodes);
    void nameOnce(const std::vector<Growth>& nodes, std::vector<std::uint64_t>& names) const;
    void ask(const Growth& g, std::size_t most);
    void abandon() noexcept;

    std::vector<Tree*> trees_;  // by address, in which order their locks are taken
    std::vector<std::unique_lock<thread::ForkAwareMutex>> locks_;
    std::vector<std::vector<std::uint32_t>> gathered_;  // lists that requests point to
    std::vector<Part> parts_;                           // one an oracle
    std::size_t submitted_ = 0, answered_ = 0;          // parts
  };

  /// A query has read the corners of this leaf from the mesh. If decay took them, they are packed when it ends.
  void noteUnpacked(NodeRef leaf) const {
    if (!is_stripped_ || noted_count_.load(std::memory_order_relaxed) >= kMostNoted) return;
    const std::size_t place = noted_count_.fetch_add(1, std::memory_order_relaxed);
    if (place < kMostNoted) noted_[place].store(leaf.bits, std::memory_order_relaxed);
  }
  /// Packs the corners of the leaves that queries have noted, unless another thread grows the tree.
  void packNoted();

  /// A batch takes an oracle long, however small it is: walks that grow together ask it less often.
  bool growsSlowly() const { return oracle_->kind() != OracleKind::kCpu; }

  // With the query lock free.

  Statistics statistics() const;
  void expandAll(int depth);
  void visit(const std::function<void(const NodeView&)>& f) const;
  void prune(Clock::time_point now);
  void updateVertices(std::vector<Eigen::Vector3d> vertices);
  void releaseMesh();
  bool isReleased() const { return is_released_; }
  /// Reads a released mesh back from the device, if exact answers need it; it goes again when the tree is at rest.
  /// @throws OracleError if the device lost it.
  void recallMesh();
  std::shared_ptr<const Mesh> mesh() const;  ///< In host memory, null if there is none.
  Eigen::AlignedBox3d bounds() const;        ///< Of the mesh, in its frame.
  /// How far the surface extends from the middle of bounds(), at most: to the farthest vertex. Found when first asked
  /// for.
  double radius() const;

  /// To be called after a query has released its locks: applies tighter bounds that growth found, and prunes if it is
  /// time. Does nothing while another query holds the lock.
  void afterQuery(std::int64_t now);

 private:
  struct Ahead;
  class BuildMemory;
  /// Where a block of a build goes: below a node; and its index, once it is added.
  struct BulkPlace {
    NodeRef node;
    std::uint32_t index = 0;
  };

  void reset(std::shared_ptr<const Mesh> mesh);
  void recallAlone();
  std::shared_ptr<const Mesh> recall();
  const oracle::Surface& grownSurface();
  void forgetMesh();

  bool growWithoutOracle(const Growth& g);
  oracle::ExpansionRequest question(NodeRef node, std::vector<std::uint32_t>& ids);
  void askFor(std::uint32_t list, oracle::ExpansionRequest& request, std::vector<std::uint32_t>& ids) const;
  // A device is not asked about fewer triangles: the host builds what is below them sooner than a batch comes back.
  static constexpr std::size_t kHostTriangles = 512;
  static std::size_t countedLevel(int level) { return static_cast<std::size_t>(std::min(level, lattice::kMaxLevel)); }
  ChildRef addOctantList(const oracle::ExpansionRequest& answer, int octant);
  /// The host has all lists, so it can grow from the root grid and in bulk.
  bool growsOnHost() const { return oracle_->kind() == OracleKind::kCpu || oracle_->kind() == OracleKind::kAuto; }
  bool buildNow();
  bool fitsBuild() const;
  void startRent();
  bool buildsAhead() const;
  template <typename Job>
  void runAhead(const Job& job);
  template <typename T>
  bool isLeftToHelper(OnDemand<T> Tree::*structure);
  template <typename T>
  bool provide(OnDemand<T> Tree::*structure);
  void leakPools();
  void dropNodeTable();
  static void buildAhead(Ahead& ahead, std::int64_t asked);
  void growRoot();
  void growFromGrid(NodeRef node);
  bool growInBulk(NodeRef node, std::vector<std::uint32_t>& ids);
  void growWhole();
  static void startPlaces(const BulkBuilder& bulk, NodeRef node, std::vector<BulkPlace>& places);
  void addBlocks(const BulkBuilder& bulk, std::vector<BulkPlace>& places, std::size_t begin, std::size_t end,
                 std::int64_t now);
  bool packs(const std::vector<BulkPlace>& places) const;
  ChildRef addLeaf(const BulkBuilder& bulk, std::uint32_t begin, std::uint32_t count, bool packed);
  void publishBulk(const BulkBuilder& bulk, const std::vector<BulkPlace>& places);
  void publishWhole(const BulkBuilder& bulk, const std::vector<BulkPlace>& places);
  void publish(NodeRef node, const oracle::ExpansionRequest& answer);
  std::uint32_t addBlock(NodeRef node, std::uint8_t grey, std::int64_t now);
  ChildRef addList(const std::uint32_t* ids, std::size_t count, bool leaf);
  void setChild(NodeRef node, ChildRef ref);
  /// True if there is a ttl and `then` is more than ttl before `now`. Both may be any times.
  bool isOld(std::int64_t then, std::int64_t now) const {
    std::int64_t age;
    return ttl_ > 0 && now > then && (__builtin_sub_overflow(now, then, &age) || age > ttl_);
  }
  enum class Pruning {
    kBudget,      ///< What exceeds the memory budget only.
    kWorthwhile,  ///< And branches unused for longer than ttl, if there are enough for the work that it is.
    kAfterRest,   ///< The same, but a rest, in which no query asked, does not count as one without use.
    kAll,         ///< All branches unused for longer than ttl.
  };
  void pruneAlone(std::int64_t now, Pruning pruning);
  void applyBudget();
  template <typename T>
  bool dropIfOld(OnDemand<T>& structure, std::int64_t now);
  using NodeCounts = std::array<std::size_t, lattice::kMaxLevel + 1>;
  enum class Fate : std::uint8_t;
  void keepOnly(const std::vector<Fate>& fates);
  bool isPacked(ChildRef ref) const { return ref.isList() && nodes_.lists.isPacked(ref.index()); }
  bool hasCorners(const Block& block) const;
  static bool isDeepestBlock(const Block& block);
  void dropTree();
  void startGeneration();
  void countNodes(ChildRef child, int level, NodeCounts& counts) const;
  void collectTriangles(ChildRef ref, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const;
  ChildRef regained(ChildRef block, const lattice::Cell& cell, TriangleLists& lists) const;
  std::size_t treeBytes() const;
  void countBytes();

  const Options options_;
  const std::int64_t ttl_;  // in ns; 0: nothing is ever old
  const std::shared_ptr<oracle::Oracle> oracle_;
  const int deepest_;
  mutable thread::ShardedLock query_lock_;
  thread::ForkAwareMutex growth_;  // guards what grow() appends to

  oracle::Surface surface_;
  // Of a model whose mesh was released.
  std::atomic<bool> is_released_{false};
  std::unique_ptr<const oracle::StoredMesh> stored_;  // unless the oracle needs no mesh in host memory
  std::unique_ptr<oracle::Surface> grown_surface_;    // surface_ with its mesh, for growth of conservative answers
  std::atomic<std::size_t> recalled_bytes_{0};        // not 0 while the mesh is in host memory again
  std::int64_t recall_time_ = 0;                      // in ns of the model's clock
  std::shared_ptr<const Solid> solid_;
  mutable thread::ForkAwareMutex component_mutex_;  // guards component_points_ while they are found
  mutable thread::Published<const std::vector<Eigen::Vector3d>> component_points_;
  mutable std::atomic<double> radius_{-1};  // negative: not known yet
  // Made under growth_, dropped alone.
  OnDemand<BoxTree> boxes_;      // rent: steps of walks
  OnDemand<Interior> interior_;  // rent: walks
  mutable std::atomic<LongSearch> long_searches_[4] = {};
  SupportTable supports_;
  // Together, as a query of two models that are far apart reads little else.
  Outline outline_;
  std::atomic<ChildRef> root_{ChildRef()};
  static constexpr std::int64_t kNeverDue = std::numeric_limits<std::int64_t>::max();
  std::atomic<std::int64_t> next_prune_;  // in ns of the model's clock
  bool supports_known_ = false;
  thread::Published<RootGrid> grid_;
  bool grid_tried_ = false;
  Rent rent_;                        // of the whole tree, see payRent()
  bool is_ahead_build_due_ = false;  // the helper thread must still be asked to build it; under growth_
  bool spared_after_rest_ = false;   // by the last look of a query; changed alone
  bool is_stripped_ = false;         // leaves of stripped blocks wait for their corners; changed alone
  // Leaves whose corners queries have missed, the root where there is none. A note may be lost or late, never wrong: it
  // is of this generation.
  static constexpr std::size_t kMostNoted = 16;
  mutable std::atomic<std::size_t> noted_count_{0};
  mutable std::array<std::atomic<std::uint32_t>, kMostNoted> noted_;
  bool is_whole_ = false;                 // it was built, and nothing of it was dropped since; under growth_ or alone
  std::atomic<bool> is_complete_{false};  // the same, but for corners of leaves
  bool has_changed_ = false;              // by updateVertices(); changed alone
  std::shared_ptr<Ahead> ahead_;
  std::uint64_t generation_ = 0;  // of nodes_: indices of blocks are of one generation
  NodeStore nodes_;
  NodeTable node_table_;                   // of a generation; under growth_
  std::vector<std::uint32_t> node_words_;  // what it was made from

  std::atomic<std::size_t> bytes_{0}, device_bytes_{0};
  std::atomic<std::uint64_t> expansions_{0}, octants_{0}, batches_{0}, cells_{0}, pruned_{0}, built_{0};
};

}  // namespace bocst::tree
