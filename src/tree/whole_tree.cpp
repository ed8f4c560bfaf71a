// SPDX-License-Identifier: BSD-3-Clause
// Growth in bulk: what is below a node at once, the whole tree, and the structures beside it, by a query or ahead of
// queries by the helper thread.
#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <new>
#include <numeric>
#include <shared_mutex>
#include <stdexcept>
#include <thread>

#include "oracle/stored_mesh.h"
#include "thread/helper_thread.h"
#include "thread/of_thread.h"
#include "tree/box_tree.h"
#include "tree/bulk.h"
#include "tree/tree.h"

namespace bocst::tree {
namespace {

// Growth by parts costs about twice as much a triangle as building all at once, the wider walks between bounds that are
// still loose included. With 4, the first 30 fresh poses of scans take half the time and the first 1000 a tenth more.
constexpr std::size_t kRent = 8;
// While the helper thread builds, queries grow parts, which soon have what they need: then a walk pays more than it
// costs. Should the thread not come to it, a query still builds the tree, after about half as many walks as triangles.
constexpr std::size_t kRentAhead = 32;
// A whole tree with the corners of its leaves takes about this many bytes a triangle, of a soup at most.
constexpr std::size_t kPackedBytes = 24;
// What a thread keeps of a build's memory for the next one, in triangles.
constexpr std::size_t kMostKept = 1 << 17;
// Blocks that the helper thread adds while queries cannot grow the tree: some tens of microseconds.
constexpr std::uint32_t kBlocksAtOnce = 16;
constexpr std::chrono::microseconds kPause(50);

/// Box and slab of a cell's surface as bytes of the cell.
bounds::NodeBounds encode(const BulkBuilder::Own& own, const lattice::Cell& cell) {
  bounds::NodeBounds b;
  encodeBox(own.box, cell, b);
  if (std::all_of(own.normal, own.normal + 3, [](int n) { return n == 0; })) return b;
  const bounds::CellFrame frame = frameOf(cell);
  double middle = 0;
  for (std::size_t k = 0; k < 3; ++k) middle += own.normal[k] * frame.middle(k);
  const double margin = 1e-6 * frame.side;
  frame.encodeSlab(own.normal, own.least - middle - margin, own.most - middle + margin, b);
  return b;
}

void buildWhole(const oracle::Surface& surface, BulkBuilder& bulk) {
  if (surface.triangle_count >= BulkBuilder::kLeastToSort && surface.mesh->vertexCount() <= BulkBuilder::kMostToSort) {
    bulk.buildAll(surface);
    return;
  }
  std::vector<std::uint32_t> ids(surface.triangle_count);
  std::iota(ids.begin(), ids.end(), 0u);
  bulk.build(surface, ids.data(), ids.size(), surface.latticeBounds());
}

}  // namespace

/// What a build needs, and a thread keeps for its next build unless this one was of many triangles.
class Tree::BuildMemory {
 public:
  explicit BuildMemory(std::size_t triangles) : triangles_(triangles) {}
  ~BuildMemory() {
    if (triangles_ > kMostKept) ofThread() = Parts();
  }
  BuildMemory(const BuildMemory&) = delete;
  BuildMemory& operator=(const BuildMemory&) = delete;

  BulkBuilder& bulk() const { return ofThread().bulk; }
  std::vector<BulkPlace>& places() const { return ofThread().places; }

 private:
  struct Parts {
    BulkBuilder bulk;
    std::vector<BulkPlace> places;
  };
  static Parts& ofThread() { return thread::ofThread<Parts>(); }

  const std::size_t triangles_;
};

/// The helper thread and the tree share this, as either may end first.
struct Tree::Ahead {
  thread::ForkAwareMutex mutex;  // of `tree`
  Tree* tree;                    // null when the tree is gone

  /// Calls f(tree), which may publish, and returns what it returns; false if the tree is gone.
  template <typename F>
  bool withTree(F&& f) {
    const std::lock_guard<thread::ForkAwareMutex> exists(mutex);
    if (tree == nullptr) return false;
    const std::shared_lock<thread::ShardedLock> query(tree->query_lock_);
    const std::lock_guard<thread::ForkAwareMutex> growth(tree->growth_);
    return f(*tree);
  }
};

Tree::~Tree() {
  try {
    if (ahead_ != nullptr) {
      const std::lock_guard<thread::ForkAwareMutex> lock(ahead_->mutex);
      ahead_->tree = nullptr;
    }
    const std::shared_lock<thread::ShardedLock> query(query_lock_);
    const std::unique_lock<thread::ForkAwareMutex> growth(growth_, std::try_to_lock);
    if (growth.owns_lock()) return;
  } catch (const std::runtime_error&) {
    // A child after fork(): the thread that held the lock is not there.
  }
  leakPools();
}

// What a thread that stayed in the parent was changing may name memory that is free, so a child never frees it.
void Tree::leakPools() {
  (new NodeStore)->swap(nodes_);
  (new decltype(node_table_.nodes))->swap(node_table_.nodes);
  (new decltype(node_words_))->swap(node_words_);
  boxes_.leak();
  interior_.leak();
}

// What exact answers need below a node whose triangles are known here. False where the oracle is to be asked: for what
// the root grid or a device knows.
bool Tree::growInBulk(NodeRef node, std::vector<std::uint32_t>& ids) {
  const ChildRef ref = this->childRef(node);
  ids.clear();
  if (ref.isList()) {
    const TriangleList list = this->list(ref);
    // A lane is no cell, so an oracle can't be asked about it.
    const bool is_for_host = growsOnHost() || isLoose(node) || list.count <= kHostTriangles;
    if (!list.ids.areKnown() || !is_for_host) return false;
    list.appendTo(ids);
  } else if (!growsOnHost()) {
    return false;
  } else if (grid_) {
    if (cell(node).level < grid_->level()) return false;
    grid_->gather(surface_, cell(node), ids);
  } else {
    growWhole();
    return true;
  }
  payRent(ids.size());
  built_ += ids.size();
  const bool is_loose = isLoose(node);
  Eigen::AlignedBox3d region;
  if (is_loose) {
    region = nodes_.blocks[node.block()].looseBox(node.octant());
  } else {
    const lattice::Cell cell = this->cell(node);
    const Eigen::Vector3d corner(cell.corner()[0], cell.corner()[1], cell.corner()[2]);
    region = Eigen::AlignedBox3d(corner, corner.array() + cell.side());
  }
  const BuildMemory memory(ids.size());
  BulkBuilder& bulk = memory.bulk();
  std::vector<BulkPlace>& places = memory.places();
  bulk.build(surface_, ids.data(), ids.size(), region);
  if (!is_loose && !bulk.ids().empty()) nodes_.addRefit(node, encode(bulk.own(), cell(node)));
  startPlaces(bulk, node, places);
  addBlocks(bulk, places, 0, bulk.blocks().size(), now());
  publishBulk(bulk, places);
  return true;
}

bool Tree::buildsAhead() const {
  return options_.build_ahead && !conservative() && options_.memory_budget == 0 && growsOnHost();
}

bool Tree::fitsBuild() const { return 3 * surface_.triangle_count <= BulkBuilder::kMostToSort; }

void Tree::startRent() {
  is_ahead_build_due_ = buildsAhead();
  // Beside a device, a build finds the supports alone.
  const bool gains = !conservative() && (growsOnHost() || !supports_known_);
  if (gains && fitsBuild()) {
    rent_.start(is_ahead_build_due_ ? 0 : surface_.triangle_count / kRent);
  } else {
    rent_.stop();
  }
}

bool Tree::buildNow() {
  const std::unique_lock<thread::ForkAwareMutex> lock(growth_, std::try_to_lock);
  if (!lock.owns_lock() || !rent_.isDue()) return false;
  if (is_ahead_build_due_) {
    is_ahead_build_due_ = false;
    rent_.setPrice(surface_.triangle_count * kRentAhead);
    // The helper thread does not call Options::clock.
    runAhead([asked = now()](Ahead& ahead) { buildAhead(ahead, asked); });
    return false;
  }
  try {
    growWhole();
  } catch (const std::bad_alloc&) {
    rent_.stop();  // the parts that queries need may still have room
    return false;
  }
  return true;
}

bool Tree::gainsByBuild() const { return !conservative() && growsOnHost() && fitsBuild(); }

void Tree::build() {
  const std::lock_guard<thread::ForkAwareMutex> lock(growth_);
  if (is_whole_) return;
  is_ahead_build_due_ = false;
  growWhole();
}

// All of the tree that exact answers need. Queries under way go on in the old blocks.
void Tree::growWhole() {
  const BuildMemory memory(surface_.triangle_count);
  BulkBuilder& bulk = memory.bulk();
  std::vector<BulkPlace>& places = memory.places();
  buildWhole(surface_, bulk);
  if (!supports_known_) {
    bulk.findSupports(supports_);
    outline_.set(bulk.findOutline(surface_.lattice));
    supports_known_ = true;
  }
  // A device has grown what is above the parts, so the host would gain little by new blocks.
  if (!growsOnHost()) return rent_.stop();
  startPlaces(bulk, NodeRef(), places);
  try {
    addBlocks(bulk, places, 0, bulk.blocks().size(), now());
    publishWhole(bulk, places);
    rent_.stop();
  } catch (const std::bad_alloc&) {
    countBytes();  // blocks stay that nothing leads to
    throw;
  }
  countBytes();
}

// Calls job(Ahead&) in the helper thread. Under growth_.
template <typename Job>
void Tree::runAhead(const Job& job) {
  try {
    if (ahead_ == nullptr) {
      ahead_ = std::make_shared<Ahead>();
      ahead_->tree = this;
    }
    thread::runInHelperThread([ahead = ahead_, job] {
      try {
        job(*ahead);
      } catch (const std::exception&) {
        // Without memory for it, or in a child after fork(): queries build what they need.
      }
    });
  } catch (const std::exception&) {
    // The system can start no more threads: queries build what they need.
  }
}

// In the helper thread: builds from the mesh alone, then adds the blocks in parts between which queries grow the tree.
void Tree::buildAhead(Ahead& ahead, std::int64_t asked) {
  std::unique_ptr<oracle::Surface> surface;
  std::uint64_t generation = 0;
  // Calls f(tree) unless the tree is gone, or is another by now, or was built by a query. Returns whether it did.
  const auto withTree = [&](auto&& f) {
    return ahead.withTree([&](Tree& tree) {
      if (tree.rent_.isStopped() || (surface != nullptr && tree.generation_ != generation)) return false;
      f(tree);
      return true;
    });
  };
  const bool is_wanted = withTree([&](Tree& tree) {
    surface.reset(new oracle::Surface{tree.surface_.mesh, tree.surface_.lattice});
    generation = tree.generation_;
  });
  if (!is_wanted) return;

  BulkBuilder bulk;
  buildWhole(*surface, bulk);
  SupportTable supports;
  supports.start(surface->latticeBounds(), surface->lattice);
  bulk.findSupports(supports);
  const Outline::Box outline = bulk.findOutline(surface->lattice);

  // Queries have gone on since the thread was asked: blocks that are older than that would decay at once.
  const auto lastUse = [&](const Tree& tree) {
    const ChildRef root = tree.root_.load(std::memory_order_relaxed);
    const bool is_block = root.tag() == ChildRef::kBlock;
    return std::max(asked, is_block ? tree.nodes_.last_use[root.index()].load(std::memory_order_relaxed) : asked);
  };
  std::vector<BulkPlace> places;
  startPlaces(bulk, NodeRef(), places);
  for (std::size_t begin = 0, end; begin < bulk.blocks().size(); begin = end) {
    end = std::min(begin + kBlocksAtOnce, bulk.blocks().size());
    if (!withTree([&](Tree& tree) { tree.addBlocks(bulk, places, begin, end, lastUse(tree)); })) return;
    // A mutex is not fair: without a pause, queries that wait for it would hardly get it.
    std::this_thread::sleep_for(kPause);
  }
  withTree([&](Tree& tree) {
    tree.rent_.stop();
    if (!tree.supports_known_) {
      for (int n = 0; n < SupportTable::kCount; ++n) tree.supports_.lower(n, static_cast<double>(supports.value(n)));
      tree.outline_.set(outline);
      tree.supports_known_ = true;
    }
    for (std::size_t number = 0; number < bulk.blocks().size(); ++number) {
      tree.nodes_.last_use[places[number].index].store(lastUse(tree), std::memory_order_relaxed);
    }
    tree.publishWhole(bulk, places);
    tree.countBytes();
  });
}

namespace {

template <typename T>
std::unique_ptr<const T> makeOf(const oracle::Surface& surface) {
  if constexpr (std::is_same<T, Interior>::value) {
    return std::make_unique<const T>(*surface.mesh, surface.lattice);
  } else {
    return std::make_unique<const T>(surface);
  }
}

}  // namespace

// True if queries go on without a structure that they have paid for, because the helper thread builds it. Under
// growth_.
template <typename T>
bool Tree::isLeftToHelper(OnDemand<T> Tree::*structure) {
  // The thread may be busy; a query that needs the structure must not go on without it for ever.
  constexpr std::size_t kTimesPaid = 4;
  if (!buildsAhead()) return false;
  if ((this->*structure).isAwaited()) return (this->*structure).rent.left() > 0;
  (this->*structure).await(kTimesPaid);
  runAhead([structure](Ahead& ahead) {
    std::unique_ptr<const oracle::Surface> surface;
    const bool is_wanted = ahead.withTree([&](Tree& tree) {
      if (tree.*structure || !(tree.*structure).isAwaited() || tree.surface_.mesh == nullptr) return false;
      surface.reset(new oracle::Surface{tree.surface_.mesh, tree.surface_.lattice});
      return true;
    });
    if (!is_wanted) return;
    std::unique_ptr<const T> made = makeOf<T>(*surface);
    ahead.withTree([&](Tree& tree) {
      if (tree.*structure || tree.surface_.mesh != surface->mesh) return false;
      (tree.*structure).set(std::move(made));
      tree.countBytes();
      return true;
    });
  });
  return true;
}

// Builds a structure that queries have paid for, if it is not left to the helper thread and there is memory; true if it
// is there. Under growth_.
template <typename T>
bool Tree::provide(OnDemand<T> Tree::*structure) {
  if (this->*structure) return true;
  if (isLeftToHelper(structure)) return false;
  try {
    (this->*structure).set(makeOf<T>(surface_));
  } catch (const std::bad_alloc&) {
    (this->*structure).rent.restart();  // queries go on without it, and try again when they have paid again
    return false;
  }
  countBytes();
  return true;
}

const BoxTree& Tree::boxes(std::int64_t now) {
  boxes_.markUsed(now);
  if (const BoxTree* known = boxes_.seen()) return *known;
  const std::lock_guard<thread::ForkAwareMutex> lock(growth_);
  if (!boxes_) {
    boxes_.set(makeOf<BoxTree>(surface_));
    countBytes();
  }
  return *boxes_.seen();
}

bool Tree::buildBoxes(std::int64_t now) {
  boxes_.markUsed(now);
  if (boxes_.seen() != nullptr) return true;
  const std::lock_guard<thread::ForkAwareMutex> lock(growth_);
  return provide(&Tree::boxes_);
}

void Tree::payInterior(std::int64_t now) {
  const std::size_t budget = options_.memory_budget;
  if (interior_.seen() != nullptr || surface_.mesh == nullptr) return;
  if (budget != 0 && Interior::mostBytesOf(surface_.triangle_count) > budget / 2) return;
  interior_.rent.pay(1);
  if (interior_.rent.left() > 0) return;
  const std::unique_lock<thread::ForkAwareMutex> lock(growth_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  interior_.markUsed(now);
  provide(&Tree::interior_);
}

// Below `node`.
void Tree::startPlaces(const BulkBuilder& bulk, NodeRef node, std::vector<BulkPlace>& places) {
  places.assign(std::max<std::size_t>(1, bulk.blocks().size()), BulkPlace());
  places[0].node = node;
}

// True if leaves of what was built are kept with their corners. Not if a build of the whole tree is about to replace
// them, or if they would take more than half of the memory budget.
bool Tree::packs(const std::vector<BulkPlace>& places) const {
  const bool is_part = !places[0].node.isRoot(), will_be_replaced = is_part && growsOnHost() && !rent_.isStopped();
  const bool fit = options_.memory_budget == 0 || kPackedBytes * surface_.triangle_count <= options_.memory_budget / 2;
  return fit && !will_be_replaced;
}

ChildRef Tree::addLeaf(const BulkBuilder& bulk, std::uint32_t begin, std::uint32_t count, bool packed) {
  const std::uint32_t* const ids = bulk.ids().data() + begin;
  PackedTriangles::Words words;
  // Lists without corners always have room.
  const std::size_t size = packed && count > 0 && !nodes_.lists.isHalfFull() ? bulk.pack(begin, count, words) : 0;
  return {ChildRef::kShortList,
          size > 0 ? nodes_.lists.addPacked(ids, count, words, size) : nodes_.lists.add(ids, count)};
}

void Tree::packNoted() {
  if (noted_count_.load(std::memory_order_relaxed) == 0 || lacksMesh()) return;
  const std::unique_lock<thread::ForkAwareMutex> lock(growth_, std::try_to_lock);
  if (!lock.owns_lock()) return;
  const BuildMemory memory(kMaxLeafTriangles);
  std::vector<std::uint32_t> ids;
  for (std::atomic<std::uint32_t>& noted : noted_) {
    const NodeRef leaf{noted.exchange(NodeRef::kRoot, std::memory_order_relaxed)};
    if (leaf.isRoot() || !nodes_.records[leaf.block()].is_stripped) continue;
    const ChildRef ref = childRef(leaf);
    if (ref.tag() != ChildRef::kShortList || isPacked(ref)) continue;
    ids.clear();
    list(ref).appendTo(ids);
    memory.bulk().build(surface_, ids.data(), ids.size(), surface_.latticeBounds());
    setChild(leaf, addLeaf(memory.bulk(), 0, static_cast<std::uint32_t>(ids.size()), true));
  }
  noted_count_.store(0, std::memory_order_relaxed);
  countBytes();
}

// Adds blocks of what was built, from number `begin` on, after those before them. No reader sees them: all but the
// first are put below their parents, and that one nowhere.
void Tree::addBlocks(const BulkBuilder& bulk, std::vector<BulkPlace>& places, std::size_t begin, std::size_t end,
                     std::int64_t now) {
  const bool packed = packs(places);
  for (std::size_t number = begin; number < end; ++number) {
    const BulkBuilder::Block& built = bulk.blocks()[number];
    BulkPlace& place = places[number];
    place.index = addBlock(place.node, static_cast<std::uint8_t>(0xff >> (8 - built.lanes)), now);
    octants_ += built.lanes;
    Block& block = nodes_.blocks[place.index];
    block.setFrame(built.frame);
    for (std::uint32_t o = 0; o < built.lanes; ++o) {
      const BulkBuilder::Lane& lane = built.lane[o];
      block.octants.set(o, built.bounds[o]);
      if (lane.block == BulkBuilder::kNone) {
        block.child[o].store(addLeaf(bulk, lane.begin, lane.count, packed), std::memory_order_relaxed);
      } else {
        places[lane.block].node = NodeRef::octant(place.index, static_cast<int>(o));
      }
    }
    if (number > 0) setChild(place.node, ChildRef(ChildRef::kBlock, place.index));
  }
}

// All blocks were added: readers see them from now on.
void Tree::publishBulk(const BulkBuilder& bulk, const std::vector<BulkPlace>& places) {
  setChild(places[0].node, bulk.blocks().empty()
                               ? addLeaf(bulk, 0, static_cast<std::uint32_t>(bulk.ids().size()), packs(places))
                               : ChildRef(ChildRef::kBlock, places[0].index));
}

// Of the whole tree.
void Tree::publishWhole(const BulkBuilder& bulk, const std::vector<BulkPlace>& places) {
  publishBulk(bulk, places);
  built_ += surface_.triangle_count;
  is_whole_ = true;
  is_complete_ = true;
}

}  // namespace bocst::tree
