// SPDX-License-Identifier: BSD-3-Clause
#include "tree/tree.h"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <new>
#include <numeric>
#include <shared_mutex>
#include <stdexcept>
#include <string>

#include "log/assert.h"
#include "log/number_text.h"
#include "oracle/stored_mesh.h"
#include "thread/of_thread.h"
#include "tree/box_tree.h"

namespace bocst::tree {
namespace {

int deepestLevel(const Options& o) {
  if (o.answer == Answer::kExact) return lattice::kMaxLevel;
  const bool more = o.paper.level_rule && o.subdivision == Subdivision::kBono && lattice::oneLevelMore(o.dimension);
  return std::min(o.depth + (more ? 1 : 0), lattice::kMaxLevel);
}

oracle::Surface surfaceOf(std::shared_ptr<const Mesh> mesh, const Options& o) {
  if (mesh == nullptr) throw std::invalid_argument("bocst::Model: the mesh is null");
  lattice::Lattice lattice(mesh->bounds(), o.subdivision, o.dimension);
  return {std::move(mesh), lattice};
}

// Of more than 292 years, the longest that there is.
std::int64_t nanoseconds(std::chrono::milliseconds ttl) {
  constexpr auto kMost = std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::nanoseconds::max());
  return std::chrono::nanoseconds(std::min(ttl, kMost)).count();
}

std::int64_t nanoseconds(Clock::time_point t) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(t.time_since_epoch()).count();
}

// The clock as of the system's last tick, a few milliseconds old: to read it to the nanosecond takes longer than a
// query of what is apart, and stamps that differ each time are written each time, to lines that threads share.
std::int64_t coarseNow() {
#ifdef CLOCK_MONOTONIC_COARSE
  timespec t;
  if (clock_gettime(CLOCK_MONOTONIC_COARSE, &t) == 0) return std::int64_t{t.tv_sec} * 1000000000 + t.tv_nsec;
#endif
  return nanoseconds(Clock::now());
}

}  // namespace

void checkOptions(const Options& o) {
  const auto bad = [](const std::string& what) { throw std::invalid_argument("bocst::Options: " + what); };
  const auto badEnum = [&](const char* name, int value) {
    bad(std::string(name) + " is " + std::to_string(value) + ", which is none of its values");
  };
  if (o.subdivision != Subdivision::kOctree && o.subdivision != Subdivision::kBono) {
    badEnum("subdivision", static_cast<int>(o.subdivision));
  }
  if (o.answer != Answer::kExact && o.answer != Answer::kConservative) badEnum("answer", static_cast<int>(o.answer));
  if (o.oracle < OracleKind::kAuto || o.oracle > OracleKind::kSampled) badEnum("oracle", static_cast<int>(o.oracle));
  if (o.depth < 1 || o.depth > lattice::kMaxLevel) {
    bad("depth is " + std::to_string(o.depth) + ", not 1 to " + std::to_string(lattice::kMaxLevel));
  }
  const double finest = 1 << lattice::kBits;
  if (o.dimension != 0 && !(o.dimension >= 1 && o.dimension <= finest)) {
    bad("dimension is " + numberText(o.dimension) + ", not 0 or 1 to 65536");
  }
  if (o.ttl.count() < 0) bad("ttl is " + std::to_string(o.ttl.count()) + " ms, which is negative");
  if (o.paper.viewport < 1 || o.paper.viewport > 4096)
    bad("viewport is " + std::to_string(o.paper.viewport) + ", not 1 to 4096");
  if (!(o.margin >= 0) || !std::isfinite(o.margin)) {
    bad("margin is " + numberText(o.margin) + ", not a length of 0 or more");
  }
}

Tree::Tree(std::shared_ptr<const Mesh> mesh, const Options& options)
    : options_((checkOptions(options), options)),
      ttl_(nanoseconds(options.ttl)),
      oracle_(oracle::makeOracle(options.oracle, options.answer, options.paper.viewport)),
      deepest_(deepestLevel(options)),
      surface_(surfaceOf(mesh, options)),
      next_prune_(options.ttl.count() > 0 ? 0 : kNeverDue) {
  reset(std::move(mesh));
}

void Tree::reset(std::shared_ptr<const Mesh> mesh) {
  solid_ = options_.solid ? std::make_shared<const Solid>(mesh) : nullptr;
  component_points_.reset();
  surface_ = surfaceOf(std::move(mesh), options_);
  // A triangle's share of building oriented boxes takes as long as this many pairs of leaves.
  constexpr std::size_t kLeafPairsPerTriangle = 4;
  boxes_.start(kLeafPairsPerTriangle * surface_.triangle_count);
  // Probes spare about half of the walks that find contact; one takes as long as the share of 32 triangles.
  constexpr std::size_t kTrianglesPerWalk = 16, kLeastWalks = 24;
  interior_.start(kLeastWalks + surface_.triangle_count / kTrianglesPerWalk);
  radius_ = -1;
  nodes_.root_bounds = bounds::NodeBounds();
  const Eigen::AlignedBox3d box = surface_.latticeBounds();
  encodeBox(box, lattice::Cell{}, nodes_.root_bounds);
  supports_known_ = false;
  const Eigen::AlignedBox3d met = queryBox();
  outline_.set(Outline::boxOf(met.center(), Eigen::Matrix3d::Identity(), met.sizes() / 2),
               [&] { supports_.start(box, surface_.lattice); });
  dropTree();
}

double Tree::sphereReach() const {
  if (!conservative()) return 0;
  const int cell_side = 1 << (lattice::kMaxLevel - deepest_);
  return std::sqrt(3.0) * (cell_side + 1) * surface_.lattice.unit();
}

Eigen::AlignedBox3d Tree::queryBox() const {
  if (!conservative()) return surface_.bounds;
  const double side = 1 << (lattice::kMaxLevel - deepest_), reach = 0.70711 * (side + 1);
  const lattice::Lattice& lattice = surface_.lattice;
  const Eigen::AlignedBox3d box = surface_.latticeBounds();
  Eigen::Array3d low, high;
  for (int k = 0; k < 3; ++k) {
    // Of the regions of cells that the surface meets, or may meet by less than a unit.
    low[k] = std::max(0.0, side * std::floor((box.min()[k] - 1) / side)) - reach;
    high[k] = std::min(static_cast<double>(lattice.extent()[static_cast<std::size_t>(k)]),
                       side * (std::floor((box.max()[k] + 1) / side) + 1)) +
              reach;
  }
  return {lattice.origin().array() + lattice.unit() * low, lattice.origin().array() + lattice.unit() * high};
}

std::int64_t Tree::now() const { return options_.clock ? nanoseconds(options_.clock()) : coarseNow(); }

const std::vector<Eigen::Vector3d>& Tree::componentPoints() const {
  if (const auto* known = component_points_.seen()) return *known;
  const std::lock_guard<thread::ForkAwareMutex> lock(component_mutex_);
  if (!component_points_) {
    component_points_.set(std::make_unique<const std::vector<Eigen::Vector3d>>(
        pointOfEachComponent(surface_.mesh->vertices(), surface_.mesh->triangles())));
  }
  return *component_points_.seen();
}

bool Tree::affordsBoxes() const {
  return options_.memory_budget == 0 || BoxTree::bytesOf(surface_.triangle_count) <= options_.memory_budget / 2;
}

std::shared_ptr<const Mesh> Tree::mesh() const {
  const std::shared_lock<thread::ShardedLock> lock(query_lock_);
  return surface_.mesh;
}

Eigen::AlignedBox3d Tree::bounds() const {
  const std::shared_lock<thread::ShardedLock> lock(query_lock_);
  return surface_.bounds;
}

double Tree::radius() const {
  const std::shared_lock<thread::ShardedLock> lock(query_lock_);
  const double known = radius_.load(std::memory_order_relaxed);
  if (known >= 0) return known;
  const Eigen::Vector3d center = surface_.bounds.center();
  const double corner = (surface_.bounds.max() - center).cwiseMax(center - surface_.bounds.min()).norm();
  double radius = corner;
  if (surface_.mesh != nullptr) {
    double squared = 0;
    for (const Eigen::Vector3d& v : surface_.mesh->vertices()) squared = std::max(squared, (v - center).squaredNorm());
    // Vertices of no triangle may lie outside of the bounds.
    if (std::isfinite(squared)) radius = std::min(corner, std::sqrt(squared));
  }
  radius_.store(radius, std::memory_order_relaxed);
  return radius;
}

void Tree::releaseMesh() {
  if (options_.solid) throw std::logic_error("bocst::Model::releaseMesh: a solid looks at its triangles on the host");
  const std::lock_guard<thread::ShardedLock> alone(query_lock_);
  if (isReleased()) return;
  componentPoints();  // all that another solid asks of it
  auto device = surface_.device;
  const bool needs_mesh = !conservative() || oracle_->needsHostMesh();
  try {
    if (device == nullptr) device = oracle_->makeResident(surface_);
    if (device == nullptr) throw OracleError("the oracle " + oracle_->name() + " needs the mesh on the host");
    if (needs_mesh) stored_ = std::make_unique<const oracle::StoredMesh>(*oracle_, *surface_.mesh);
  } catch (const OracleError& e) {
    throw OracleError(std::string("bocst::Model::releaseMesh: ") + e.what());
  }
  surface_.device = std::move(device);
  is_released_ = true;
  surface_.mesh = nullptr;
  countBytes();
}

void Tree::recallMesh() {
  const std::lock_guard<thread::ShardedLock> alone(query_lock_);
  recallAlone();
}

void Tree::recallAlone() {
  if (!lacksMesh()) return;
  surface_.mesh = recall();
}

std::shared_ptr<const Mesh> Tree::recall() {
  std::shared_ptr<const Mesh> mesh = stored_->recall();
  recall_time_ = now();
  recalled_bytes_ = mesh->bytes();
  return mesh;
}

// What an oracle that works on the host is asked about. While the growth mutex is held.
const oracle::Surface& Tree::grownSurface() {
  if (surface_.mesh != nullptr || stored_ == nullptr) return surface_;
  if (grown_surface_ == nullptr) {
    const std::shared_ptr<const Mesh> mesh = recall();
    grown_surface_.reset(new oracle::Surface{mesh, surface_.lattice, surface_.device});
  }
  return *grown_surface_;
}

// The mesh of a tree at rest goes from host memory again.
void Tree::forgetMesh() {
  if (recalled_bytes_ == 0) return;
  surface_.mesh = nullptr;
  grown_surface_ = nullptr;
  recalled_bytes_ = 0;
}

// Growth.

void Tree::grow(const std::vector<Growth>& nodes) {
  if (!nodes.empty()) Batch(nodes).finish();
}

// Each node once, as numbers, which sort several times as fast: its tree among trees_, the node, and whether a list
// suffices. Of two growths of a node, the one that needs its octants comes first and stays.
void Tree::Batch::nameOnce(const std::vector<Growth>& nodes, std::vector<std::uint64_t>& names) const {
  names.clear();
  std::uint64_t number = 0;
  for (const Growth& g : nodes) {
    if (g.tree != trees_[number]) {
      const auto at = std::lower_bound(trees_.begin(), trees_.end(), g.tree, std::less<Tree*>());
      number = static_cast<std::uint64_t>(at - trees_.begin());
    }
    names.push_back(number << 33 | std::uint64_t{g.node.bits} << 1 | std::uint64_t{g.list_suffices});
  }
  std::sort(names.begin(), names.end());
  names.erase(
      std::unique(names.begin(), names.end(), [](std::uint64_t a, std::uint64_t b) { return a >> 1 == b >> 1; }),
      names.end());
}

Tree::Batch::Batch(const std::vector<Growth>& nodes) {
  lockTrees(nodes);
  struct Names {
    std::vector<std::uint64_t> names;
  };
  std::vector<std::uint64_t>& names = thread::ofThread<Names>().names;
  nameOnce(nodes, names);
  gathered_.reserve(names.size());
  for (const std::uint64_t name : names) {
    const Growth g{trees_[name >> 33], NodeRef{static_cast<std::uint32_t>(name >> 1)}, (name & 1) != 0};
    if (!g.tree->growWithoutOracle(g)) ask(g, names.size());
  }
  // From here on, oracles may write to the requests.
  try {
    for (; submitted_ < parts_.size(); ++submitted_) parts_[submitted_].oracle->submit(parts_[submitted_].requests);
  } catch (...) {
    abandon();
    throw;
  }
}

// Every growth locks its trees in address order.
void Tree::Batch::lockTrees(const std::vector<Growth>& nodes) {
  for (const Growth& g : nodes) {
    if (trees_.empty() || g.tree != trees_.back()) trees_.push_back(g.tree);
  }
  std::sort(trees_.begin(), trees_.end(), std::less<Tree*>());
  trees_.erase(std::unique(trees_.begin(), trees_.end()), trees_.end());
  for (Tree* tree : trees_) locks_.emplace_back(tree->growth_);
}

// Adds the question about a node to those for its oracle, of which there are at most `most`.
void Tree::Batch::ask(const Growth& g, std::size_t most) {
  oracle::Oracle* const oracle = g.tree->oracle_.get();
  auto part = std::find_if(parts_.begin(), parts_.end(), [oracle](const Part& p) { return p.oracle == oracle; });
  if (part == parts_.end()) {
    part = parts_.insert(parts_.end(), {oracle, {}, {}});
    part->nodes.reserve(most);
    part->requests.reserve(most);
  }
  part->nodes.push_back(g);
  gathered_.emplace_back();
  part->requests.push_back(g.tree->question(g.node, gathered_.back()));
}

void Tree::Batch::finish() {
  while (answered_ < submitted_) {
    Part& part = parts_[answered_++];
    part.oracle->wait(part.requests);
    for (std::size_t i = 0; i < part.requests.size(); ++i) {
      part.nodes[i].tree->publish(part.nodes[i].node, part.requests[i]);
      part.nodes[i].tree->cells_ += 8;
    }
  }
  for (Tree* tree : trees_) {
    const auto asks = [tree](const Part& part) {
      return std::any_of(part.nodes.begin(), part.nodes.end(), [tree](const Growth& g) { return g.tree == tree; });
    };
    if (std::any_of(parts_.begin(), parts_.end(), asks)) ++tree->batches_;
    tree->countBytes();
  }
  trees_.clear();
  locks_.clear();
}

// Nobody wants the answers, but the oracles still write them.
void Tree::Batch::abandon() noexcept {
  while (answered_ < submitted_) {
    Part& part = parts_[answered_++];
    try {
      part.oracle->wait(part.requests);
    } catch (...) {
      // The first error is on its way.
    }
  }
}

// Grows a node where that takes no oracle, or nothing has to grow any more. Nodes that grew before it in its batch
// count.
bool Tree::growWithoutOracle(const Growth& g) {
  const ChildRef ref = childRef(g.node);
  if (ref.tag() == ChildRef::kBlock || (g.list_suffices && ref.tag() == ChildRef::kShortList)) return true;
  if (g.node.isRoot()) growRoot();
  struct Ids {
    std::vector<std::uint32_t> ids;
  };
  std::vector<std::uint32_t>& ids = thread::ofThread<Ids>().ids;
  if (g.list_suffices && growInBulk(g.node, ids)) return true;
  if (grid_ && cell(g.node).level < grid_->level()) {
    growFromGrid(g.node);
    return true;
  }
  const std::size_t count = surface_.triangle_count;
  if (!g.node.isRoot() || ref.isList() || !g.list_suffices || count > kMaxLeafTriangles) return false;
  ids.resize(count);
  std::iota(ids.begin(), ids.end(), 0u);
  setChild(g.node, addList(ids.data(), count, true));
  return true;
}

// What an oracle is asked about a node; `ids` must stay as long as the question.
oracle::ExpansionRequest Tree::question(NodeRef node, std::vector<std::uint32_t>& ids) {
  const ChildRef ref = childRef(node);
  oracle::ExpansionRequest request;
  request.surface = &grownSurface();
  request.cell = cell(node);
  // Leaves are tested here; trees of conservative answers have none.
  request.ids_up_to = conservative()                      ? 0
                      : isDeepest(request.cell.level + 1) ? oracle::ExpansionRequest::kAll
                                                          : kHostTriangles;
  if (ref.isList()) {
    askFor(ref.index(), request, ids);
  } else if (node.isRoot()) {
    request.count = surface_.triangle_count;
  } else {
    BOCST_ASSERT(grid_);
    ids.reserve(4 * kMaxLeafTriangles);
    grid_->gather(surface_, request.cell, ids);
    request.ids = ids.data();
    request.count = ids.size();
  }
  return request;
}

void Tree::askFor(std::uint32_t list, oracle::ExpansionRequest& request, std::vector<std::uint32_t>& ids) const {
  const TriangleList triangles = nodes_.lists[list];
  request.count = triangles.count;
  if (nodes_.lists.isOnDevice(list)) {
    const TriangleLists::Place place = nodes_.lists.place(list);
    request.resource = place.resource;
    request.resource_begin = place.begin;
    return;
  }
  ids.reserve(std::max<std::size_t>(1, triangles.count));  // null is another question
  triangles.appendTo(ids);
  request.ids = ids.data();
}

void Tree::growRoot() {
  if (surface_.device == nullptr) surface_.device = oracle_->makeResident(grownSurface());
  if (grid_tried_ || !growsOnHost()) return;
  grid_tried_ = true;
  grid_.set(RootGrid::make(surface_, deepest_));
  if (!grid_) return;
  ++batches_;
  for (int level = 2; level <= grid_->level(); ++level) cells_ += std::uint64_t{1} << 3 * (level - 1);
}

void Tree::growFromGrid(NodeRef node) {
  const lattice::Cell cell = this->cell(node);
  std::uint8_t grey = 0;
  for (int o = 0; o < 8; ++o) {
    if (grid_->grey(surface_, cell.octant(o))) grey |= 1 << o;
  }
  const std::uint32_t index = addBlock(node, grey, now());
  for (int o = 0; o < 8; ++o) octants_ += surface_.lattice.exists(cell.octant(o));
  Block& block = nodes_.blocks[index];
  block.setCell(cell);
  const Eigen::AlignedBox3d all = surface_.latticeBounds();
  Eigen::AlignedBox3d own;
  for (int o = 0; o < 8; ++o) {
    if ((grey >> o & 1) == 0) continue;
    const Eigen::AlignedBox3d box = grid_->bounds(cell.octant(o)).intersection(all);
    bounds::NodeBounds bounds;
    encodeBox(box, cell.octant(o), bounds);
    block.octants.set(static_cast<std::size_t>(o), bounds);
    own.extend(box);
  }
  bounds::NodeBounds& bounds_of_all = nodes_.records[index].own;
  encodeBox(own, cell, bounds_of_all);
  nodes_.addRefit(node, bounds_of_all);
  setChild(node, ChildRef(ChildRef::kBlock, index));
}

std::uint32_t Tree::addBlock(NodeRef node, std::uint8_t grey, std::int64_t now) {
  const std::uint32_t index = nodes_.append(node, grey, now);
  ++expansions_;
  return index;
}

ChildRef Tree::addList(const std::uint32_t* ids, std::size_t count, bool leaf) {
  const std::uint32_t index = nodes_.lists.add(ids, count);
  return ChildRef(leaf || count <= kMaxLeafTriangles ? ChildRef::kShortList : ChildRef::kList, index);
}

ChildRef Tree::addOctantList(const oracle::ExpansionRequest& answer, int octant) {
  const std::size_t count = answer.listSize(octant),
                    all = std::accumulate(answer.sizes.begin(), answer.sizes.end(), std::size_t{0});
  // Triangles so large that division only copies them: going on would take memory without end and cull nothing.
  const bool hopeless = all > 2 * answer.count && 4 * count > 3 * answer.count;
  const oracle::ExpansionRequest::DeviceList kept = answer.deviceList(octant);
  if (kept.count == 0) return addList(answer.listBegin(octant), count, hopeless);
  if (hopeless && !conservative()) {
    // A leaf's triangles are needed here.
    std::vector<std::uint32_t> ids(count);
    if (oracle_->fetch(*answer.batch->on_device, kept, ids.data())) return addList(ids.data(), count, true);
  }
  return ChildRef(ChildRef::kList, nodes_.lists.addDeviceList(kept.count, {answer.batch->on_device, kept.begin}));
}

void Tree::setChild(NodeRef node, ChildRef ref) {
  std::atomic<ChildRef>& place = node.isRoot() ? root_ : nodes_.blocks[node.block()].child[node.octant()];
  place.store(ref, std::memory_order_release);
}

void Tree::publish(NodeRef node, const oracle::ExpansionRequest& answer) {
  if (answer.grey != 0) nodes_.addRefit(node, answer.own);
  const std::uint32_t index = addBlock(node, answer.grey, now());
  for (int o = 0; o < 8; ++o) octants_ += surface_.lattice.exists(answer.cell.octant(o));
  Block& block = nodes_.blocks[index];
  block.setCell(answer.cell);
  block.octants = answer.octants;
  nodes_.records[index].own = answer.own;
  if (answer.on_device != 0) {
    const ChildRef own = childRef(node);
    if (own.isList()) nodes_.records[index].own_list = own.index();
  }
  for (int o = 0; o < 8; ++o) {
    if (answer.grey >> o & 1) block.child[o].store(addOctantList(answer, o), std::memory_order_relaxed);
  }
  setChild(node, ChildRef(ChildRef::kBlock, index));
}

void Tree::prune(Clock::time_point now) {
  const std::lock_guard<thread::ShardedLock> alone(query_lock_);
  pruneAlone(nanoseconds(now), Pruning::kAll);
}

void Tree::updateVertices(std::vector<Eigen::Vector3d> vertices) {
  const std::lock_guard<thread::ShardedLock> alone(query_lock_);
  if (isReleased()) throw std::logic_error("bocst::Model::updateVertices: the mesh was released");
  const Mesh& old = *surface_.mesh;
  if (vertices.size() != old.vertexCount()) {
    throw std::invalid_argument("bocst::Model::updateVertices: " + std::to_string(vertices.size()) +
                                " vertices, but the mesh has " + std::to_string(old.vertexCount()));
  }
  reset(old.withVertices(std::move(vertices)));
  has_changed_ = true;
}

Tree::NodeTable Tree::nodeTable() {
  namespace table = oracle::node_table;
  const std::lock_guard<thread::ForkAwareMutex> lock(growth_);
  const std::uint32_t known = node_table_.blocks, count = nodes_.blocks.size();
  if (node_table_.nodes != nullptr && known == count) return node_table_;
  const auto blockOf = [](ChildRef ref) { return ref.tag() == ChildRef::kBlock ? ref.index() : table::kNone; };
  node_words_.resize(std::size_t{count} * table::kWords);
  for (std::uint32_t i = known; i < count; ++i) {
    const Block& block = nodes_.blocks[i];
    std::uint32_t* const row = node_words_.data() + std::size_t{i} * table::kWords;
    row[table::kPlace] = block.at[0] | std::uint32_t{block.at[1]} << 16;
    row[table::kShape] = block.at[2] | std::uint32_t{block.shape} << 16 | std::uint32_t{block.grey} << 24;
    std::fill_n(row + table::kChildren, 8, table::kNone);
    const NodeRef node = nodes_.records[i].parent;  // its block is an earlier one
    if (node.isRoot()) continue;
    node_words_[std::size_t{node.block()} * table::kWords + table::kChildren + node.octant()] = blockOf(childRef(node));
  }
  node_table_.nodes = nullptr;  // frees the room of the last table before the next one takes its own
  node_table_ = {oracle_->uploadNodes(node_words_), count, blockOf(root_.load())};
  if (node_table_.nodes == nullptr) dropNodeTable();
  countBytes();
  return node_table_;
}

void Tree::dropNodeTable() {
  node_table_ = {};
  std::vector<std::uint32_t>().swap(node_words_);
}

// Inspection.

void Tree::expandAll(int depth) {
  if (depth < 1 || depth > lattice::kMaxLevel) {
    throw std::invalid_argument("bocst::Model::expandAll: depth is " + std::to_string(depth) + ", not 1 to " +
                                std::to_string(lattice::kMaxLevel));
  }
  // Queries never expand a leaf, and do not expect that somebody does.
  const std::lock_guard<thread::ShardedLock> alone(query_lock_);
  recallAlone();
  dropTree();
  constexpr std::size_t kBatch = 1024;  // bounds the memory that answers take before they are published
  std::vector<NodeRef> level{NodeRef{}}, next;
  for (int l = 1; l < depth; ++l) {
    for (std::size_t begin = 0; begin < level.size(); begin += kBatch) {
      std::vector<Growth> batch;
      for (std::size_t i = begin; i < std::min(begin + kBatch, level.size()); ++i) {
        batch.push_back({this, level[i], false});
      }
      grow(batch);
    }
    next.clear();
    for (const NodeRef node : level) {
      const std::uint32_t index = childRef(node).index();
      for (int o = 0; o < 8; ++o) {
        if (nodes_.blocks[index].grey >> o & 1) next.push_back(NodeRef::octant(index, o));
      }
    }
    level.swap(next);
  }
}

void Tree::visit(const std::function<void(const NodeView&)>& f) const {
  const std::shared_lock<thread::ShardedLock> lock(query_lock_);
  const auto id = [](NodeRef node) { return node.isRoot() ? 0 : node.bits + 1; };
  struct Entry {
    NodeRef node;
    std::uint32_t parent;
    int level;
  };
  std::vector<Entry> stack{{NodeRef{}, NodeView::kNone, 1}};
  while (!stack.empty()) {
    const Entry e = stack.back();
    stack.pop_back();
    NodeView view;
    view.id = id(e.node);
    view.parent = e.parent;
    view.object = isReleased() ? nullptr : surface_.mesh.get();
    view.n = surface_.lattice.rootExponent() - (e.level - 1);
    view.level = e.level;
    Eigen::Vector3d center, half;
    if (isLoose(e.node)) {
      const Eigen::AlignedBox3d box = nodes_.blocks[e.node.block()].looseBox(e.node.octant());
      center = box.center();
      half = box.sizes() / 2;
      view.is_cell = false;
    } else {
      const lattice::Cell cell = this->cell(e.node);
      surface_.lattice.region(cell, center, half);
      view.cell = cell.at;
    }
    view.center = surface_.lattice.origin() + surface_.lattice.unit() * center;
    view.radius = surface_.lattice.unit() * half.norm();
    const ChildRef ref = this->childRef(e.node);
    if (ref.tag() == ChildRef::kBlock) {
      const Block& block = nodes_.blocks[ref.index()];
      for (int o = 0; o < 8; ++o) {
        if ((block.grey >> o & 1) == 0) continue;
        const NodeRef child = NodeRef::octant(ref.index(), o);
        view.children.ids[view.children.count++] = id(child);
        stack.push_back({child, view.id, e.level + 1});
      }
    }
    f(view);
  }
}

Statistics Tree::statistics() const {
  const std::shared_lock<thread::ShardedLock> lock(query_lock_);
  Statistics s;
  s.resident_bytes = bytes_;
  NodeCounts nodes{};
  nodes[1] = 1;
  countNodes(root_.load(std::memory_order_acquire), 1, nodes);
  for (std::size_t level = 1; level < nodes.size() && nodes[level] > 0; ++level) {
    s.nodes_per_level.push_back(nodes[level]);
    s.resident_nodes += nodes[level];
  }
  s.expansions = expansions_;
  s.expanded_octants = octants_;
  s.oracle_batches = batches_;
  s.oracle_cells = cells_;
  s.pruned_nodes = pruned_;
  s.built_triangles = built_;
  s.mesh_bytes = isReleased() ? recalled_bytes_.load() : surface_.mesh->bytes();
  if (solid_ != nullptr) s.mesh_bytes += solid_->bytes();
  s.device_bytes = device_bytes_;
  return s;
}

// Adds the nodes below `child`, which a node of this level has.
void Tree::countNodes(ChildRef child, int level, NodeCounts& counts) const {
  if (child.tag() != ChildRef::kBlock) return;
  const Block& block = nodes_.blocks[child.index()];
  counts[countedLevel(level + 1)] += static_cast<std::size_t>(__builtin_popcount(block.grey));
  for (int o = 0; o < 8; ++o) {
    if (block.grey >> o & 1) countNodes(block.child[o].load(std::memory_order_acquire), level + 1, counts);
  }
}

void Tree::countBytes() {
  bytes_ = treeBytes();
  std::size_t device = surface_.device != nullptr ? surface_.device->bytes() : 0;
  if (stored_ != nullptr) device += stored_->bytes();
  if (node_table_.nodes != nullptr) device += node_table_.nodes->bytes();
  device_bytes_ = device + nodes_.lists.deviceBytes();
}

std::size_t Tree::treeBytes() const {
  return nodes_.bytes() + (grid_ ? grid_->bytes() : 0) + node_words_.capacity() * sizeof(node_words_[0]) +
         boxes_.bytes() + interior_.bytes();
}

}  // namespace bocst::tree
