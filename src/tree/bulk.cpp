// SPDX-License-Identifier: BSD-3-Clause
#include "tree/bulk.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "simd/float4.h"

namespace bocst::tree {
namespace {

using V4 = Eigen::Array4f;  // three coordinates and bits that nobody computes with, in one register

// Chosen by build time and by `bench --scenarios fresh`: 8 to 16 and 64 to 256 differ by less than 10 %.
constexpr std::uint32_t kSmallPiece = 12;            // is not divided further where a block has lanes left
constexpr std::uint32_t kMostInCluster = 16;         // neighbours along the curve that stay together in large pieces
constexpr std::uint32_t kMostOneByOne = 64;          // smaller pieces are divided triangle by triangle
constexpr std::size_t kMostInSlab = 4096;            // above, the surface is no slab and the pass over it is long
constexpr std::size_t kMostOnCoarseCurve = 1 << 18;  // a curve of 2^7 cells along each axis parts this many
constexpr std::uint32_t kMostInSupportPiece = 512;   // the finest pieces that supports are sought by
constexpr int kBins = 8;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kRowPad = 16;     // kernels read whole vectors
constexpr std::size_t kFloats = 3 * 4;  // of a triangle's corners in places_

bool encodeNormal(const float (&direction)[3], std::int8_t (&bytes)[3]) {
  return bounds::encodeNormal(direction[0], direction[1], direction[2], bytes);
}

V4 load(const float (&values)[4]) { return Eigen::Map<const V4>(values); }
void store(const V4& from, float* to) {
  Eigen::Map<V4> map(to);
  map = from;
}
V4 all(float x) { return V4::Constant(x); }
// Not by Eigen's constructor of four numbers: it writes them to memory one by one, and then waits to read them as one.
V4 rounded(const Eigen::Vector3d& p) {
  const simd::Float4 v{static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 0.0f};
  V4 all;
  std::memcpy(all.data(), &v, sizeof v);
  return all;
}

float areaOf(const V4& lo, const V4& hi) {
  const V4 e = hi - lo;
  const float x = e[0], y = e[1], z = e[2];
  return x * (y + z) + y * z;
}

// What float coordinates no larger than `size` are off by, and sums of products of three of them with bytes of a normal
// in multiples of kMostNormalNorm1.
double marginOf(float size) { return 8 * 0x1p-24 * static_cast<double>(size); }

}  // namespace

void BulkBuilder::build(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count,
                        const Eigen::AlignedBox3d& region) {
  base_ = region.center().array().floor();
  const Eigen::Vector3d lo = region.min() - base_, hi = region.max() - base_;
  least_ << (lo.array() - 0.01).cast<float>(), -kInfinity;
  most_ << (hi.array() + 0.01).cast<float>(), kInfinity;
  V4 reach = all(0);
  const Eigen::Vector3d origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  const Mesh& mesh = *surface.mesh;
  // Each triangle has three places of its own.
  makeRoom(count, 3 * count, 0);
  std::uint32_t kept = 0;
  constexpr std::size_t kAhead = 8;
  for (std::size_t i = 0; i < count; ++i) {
    // The triangles of a part lie anywhere in the mesh.
    if (i + 2 * kAhead < count) __builtin_prefetch(&mesh.indices(ids[i + 2 * kAhead]));
    if (i + kAhead < count) {
      for (const std::uint32_t v : mesh.indices(ids[i + kAhead])) __builtin_prefetch(mesh.vertex(v).data());
    }
    const Mesh::Indices& v = mesh.indices(ids[i]);
    V4 least = all(kInfinity), most = all(-kInfinity);
    for (std::size_t k = 0; k < 3; ++k) {
      const V4 at = rounded((mesh.vertex(v[k]) - origin) * inverse_unit - base_);
      store(at, &places_[kFloats * kept + 4 * k]);
      least = least.min(at);
      most = most.max(at);
    }
    reach = reach.max(least.abs()).max(most.abs());
    least = least.max(least_);
    most = most.min(most_);
    if ((least > most).any()) continue;
    store(least, items_[kept].lo);
    store(most, items_[kept].hi);
    given_[kept++] = ids[i];
  }
  for (std::size_t i = own_corners_.size(); i < kept; ++i) {
    const auto first = static_cast<std::uint32_t>(3 * i);
    own_corners_.push_back({first, first + 1, first + 2});
  }
  size_ = reach.maxCoeff();
  count_ = kept;
  place_count_ = 3 * kept;
  cluster_count_ = 0;
  divide();
  finish(own_corners_.data(), order_);
}

void BulkBuilder::buildAll(const oracle::Surface& surface) {
  const Mesh& mesh = *surface.mesh;
  const std::size_t vertices = mesh.vertexCount(), count = mesh.triangleCount();
  if (count < kLeastToSort || vertices > kMostToSort) throw std::length_error("bocst: a mesh that cannot be sorted");
  base_.setConstant(lattice::kMiddle);
  least_.setConstant(-kInfinity);
  most_.setConstant(kInfinity);
  const Eigen::Vector3d origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  const auto place = [&](const Eigen::Vector3d& p) { return Eigen::Vector3d((p - origin) * inverse_unit - base_); };
  const Eigen::Vector3d least = place(surface.bounds.min()), most = place(surface.bounds.max());
  size_ = 1.001f * static_cast<float>(least.cwiseAbs().cwiseMax(most.cwiseAbs()).maxCoeff());
  makeRoom(count, vertices, count);
  for (std::size_t v = 0; v < vertices; ++v) {
    store(rounded(place(mesh.vertex(v))), &places_[4 * v]);
  }

  CurveCells cells;
  cells.bits = count <= kMostOnCoarseCurve ? 7 : 10;
  for (int k = 0; k < 3; ++k) cells.corner[k] = static_cast<float>(least[k]);
  const double longest = (most - least).maxCoeff();
  cells.scale = longest > 0 ? static_cast<float>((1 << cells.bits) / longest) : 0;
  curveKeys(mesh.triangles().data(), count, places_, cells, keys_);
  sortKeys(cells.bits);
  boxTriangles(mesh.triangles().data(), places_, keys_, count, given_, items_);
  cluster_count_ = 0;
  cluster(0, static_cast<std::uint32_t>(count));
  divide();
  finish(mesh.triangles().data(), ids_.data());
}

// Fresh memory costs more than what is done with it here, so all of it comes at once, in huge pages if it is much. In a
// virtual machine that returns free memory to its host, a new huge page may cost 5 ms, ten times what small pages cost.
void BulkBuilder::makeRoom(std::size_t triangles, std::size_t places, std::size_t clusters) {
  constexpr std::size_t kLine = 64, kMostOnSmallPages = 1 << 24;
  std::size_t bytes = 0;
  const auto take = [&bytes, this](auto*& values, std::size_t count) {
    if (memory_ != nullptr) values = reinterpret_cast<std::remove_reference_t<decltype(values)>>(memory_ + bytes);
    bytes += (count * sizeof(*values) + kLine - 1) / kLine * kLine;
  };
  const auto takeAll = [&] {
    bytes = 0;
    take(places_, 4 * places);
    take(given_, triangles);
    take(order_, triangles);
    // The rows are made when all is divided, and need the room that only the division used.
    const std::size_t shared = bytes;
    take(keys_, triangles);
    take(keys_room_, triangles);
    take(items_, triangles);
    take(order_room_, triangles);
    take(bins_, triangles);
    take(cluster_order_, clusters);
    take(clusters_, clusters);
    const std::size_t end = std::exchange(bytes, shared);
    take(rows_, 9 * (triangles + kRowPad));
    bytes = std::max(bytes, end);
  };
  count_ = triangles;
  place_count_ = places;
  takeAll();
  if (bytes <= room_) return;
  room_ = 0;  // should there be no memory
  memory_ = nullptr;
  huge_pages_ = memory::HugePages();
  few_pages_.reset();
  if (bytes <= kMostOnSmallPages) {
    few_pages_.reset(new std::byte[bytes]);
    memory_ = few_pages_.get();
  } else {
    huge_pages_ = memory::HugePages(bytes);
    memory_ = static_cast<std::byte*>(huge_pages_.begin());
  }
  room_ = bytes;
  takeAll();
}

void BulkBuilder::sortKeys(int bits) {
  const int passes = bits <= 7 ? 2 : 3, digit = (3 * bits + passes - 1) / passes;
  const std::uint32_t most = (1u << digit) - 1;
  std::uint32_t starts[3][1 << 11] = {};
  for (std::size_t i = 0; i < count_; ++i) {
    const SortKey key = keys_[i];
    for (int pass = 0; pass < passes; ++pass) ++starts[pass][key.code >> (digit * pass) & most];
  }
  for (int pass = 0; pass < passes; ++pass) {
    std::uint32_t sum = 0;
    for (std::uint32_t& start : starts[pass]) {
      const std::uint32_t size = start;
      start = sum;
      sum += size;
    }
    for (std::size_t i = 0; i < count_; ++i) {
      const SortKey key = keys_[i];
      keys_room_[starts[pass][key.code >> (digit * pass) & most]++] = key;
    }
    std::swap(keys_, keys_room_);
  }
}

// Makes clusters of sorted triangles, divided where their keys first differ; those that no key parts stay alone.
void BulkBuilder::cluster(std::uint32_t begin, std::uint32_t count) {
  if (count <= kMostInCluster) return addCluster(begin, count);
  const std::uint32_t differ = keys_[begin].code ^ keys_[begin + count - 1].code;
  if (differ == 0) {
    for (std::uint32_t i = begin; i < begin + count; ++i) addCluster(i, 1);
    return;
  }
  const std::uint32_t bit = 1u << (31 - __builtin_clz(differ));
  const SortKey* const first = keys_ + begin;
  const SortKey* const second =
      std::partition_point(first, first + count, [bit](const SortKey& key) { return (key.code & bit) == 0; });
  const auto half = static_cast<std::uint32_t>(second - first);
  cluster(begin, half);
  cluster(begin + half, count - half);
}

void BulkBuilder::addCluster(std::uint32_t begin, std::uint32_t count) {
  V4 lo = all(kInfinity), hi = all(-kInfinity);
  for (std::uint32_t i = begin; i < begin + count; ++i) {
    lo = lo.min(load(items_[i].lo));
    hi = hi.max(load(items_[i].hi));
  }
  Cluster& cluster = clusters_[cluster_count_++];
  store(lo, cluster.box.lo);
  store(hi, cluster.box.hi);
  cluster.begin = begin;
  cluster.count = count;
}

// Makes the blocks over given_ and items_.
void BulkBuilder::divide() {
  const auto count = static_cast<std::uint32_t>(count_);
  if (cluster_count_ == 0) std::iota(order_, order_ + count, 0u);
  std::iota(cluster_order_, cluster_order_ + cluster_count_, 0u);
  blocks_.clear();
  if (count > kMaxLeafTriangles) addBlock({0, count, 0, cluster_count_});
  ids_.resize(count);
  for (std::size_t i = 0; i < count; ++i) ids_[i] = given_[order_[i]];
}

namespace {

// The first bin of the second part where the sum of areas times triangles is least, of `count` triangles in bins;
// neither part has less than an eighth, so that seven divisions of the largest leave less than half. 0 where there is
// none.
int bestSplit(const V4 (&lo)[kBins], const V4 (&hi)[kBins], const std::uint32_t (&counts)[kBins],
              std::uint32_t all_in) {
  const std::uint32_t few = std::max(all_in / 8, 1u);
  float after[kBins];
  V4 box_lo = all(kInfinity), box_hi = all(-kInfinity);
  std::uint32_t count = 0;
  for (int b = kBins - 1; b > 0; --b) {
    box_lo = box_lo.min(lo[b]);
    box_hi = box_hi.max(hi[b]);
    count += counts[b];
    after[b] = count == 0 ? 0 : areaOf(box_lo, box_hi) * static_cast<float>(count);
  }
  box_lo = all(kInfinity), box_hi = all(-kInfinity);
  count = 0;
  int best = 0;
  float best_cost = kInfinity;
  for (int b = 1; b < kBins; ++b) {
    box_lo = box_lo.min(lo[b - 1]);
    box_hi = box_hi.max(hi[b - 1]);
    count += counts[b - 1];
    if (count < few || all_in - count < few) continue;
    const float cost = areaOf(box_lo, box_hi) * static_cast<float>(count) + after[b];
    if (cost < best_cost) best_cost = cost, best = b;
  }
  return best;
}

}  // namespace

// Divides items in two, where the areas are least (bestSplit) along the longest axis of the middles, else in the
// middle. `order` has their numbers; they are `count` triangles.
template <typename Items>
BulkBuilder::Half BulkBuilder::split(std::uint32_t* order, std::uint32_t items, std::uint32_t count, Items all_items) {
  V4 least = all(kInfinity), most = all(-kInfinity);
  for (std::uint32_t i = 0; i < items; ++i) {
    const TriangleBox& box = all_items.boxOf(order[i]);
    const V4 twice = load(box.lo) + load(box.hi);
    least = least.min(twice);
    most = most.max(twice);
  }
  int axis = 0;
  for (int k = 1; k < 3; ++k) axis = most[k] - least[k] > most[axis] - least[axis] ? k : axis;
  const float extent = most[axis] - least[axis];
  int best = 0;
  if (extent > 1e-30f) {  // of less, the inverse below is infinite
    const float first = least[axis], per = 0.9999f * kBins / extent;
    V4 lo[kBins], hi[kBins];
    std::uint32_t counts[kBins] = {};
    for (int b = 0; b < kBins; ++b) lo[b] = all(kInfinity), hi[b] = all(-kInfinity);
    for (std::uint32_t i = 0; i < items; ++i) {
      const TriangleBox& box = all_items.boxOf(order[i]);
      const auto b = static_cast<int>((box.lo[axis] + box.hi[axis] - first) * per);
      bins_[i] = static_cast<std::uint8_t>(b);
      lo[b] = lo[b].min(load(box.lo));
      hi[b] = hi[b].max(load(box.hi));
      counts[b] += all_items.trianglesOf(order[i]);
    }
    best = bestSplit(lo, hi, counts, count);
  }
  Half half{0, 0};
  if (best == 0) {
    const auto twiceMiddle = [&](std::uint32_t i) { return all_items.boxOf(i).lo[axis] + all_items.boxOf(i).hi[axis]; };
    half.items = items / 2;
    if (extent > 0) {
      std::nth_element(order, order + half.items, order + items,
                       [&](std::uint32_t x, std::uint32_t y) { return twiceMiddle(x) < twiceMiddle(y); });
    }
    for (std::size_t i = 0; i < half.items; ++i) half.triangles += all_items.trianglesOf(order[i]);
    return half;
  }
  // Without a branch, which would be guessed wrong half of the time.
  std::uint32_t behind = 0;
  for (std::uint32_t i = 0; i < items; ++i) {
    const bool is_before = bins_[i] < best;
    const std::uint32_t item = order[i];
    order[half.items] = item;
    order_room_[behind] = item;
    half.items += is_before;
    behind += !is_before;
    half.triangles += is_before ? all_items.trianglesOf(item) : 0;
  }
  std::copy_n(order_room_, behind, order + half.items);
  return half;
}

// Replaces the clusters of a piece by their triangles.
void BulkBuilder::layOut(Piece& piece) {
  std::uint32_t* to = order_ + piece.begin;
  for (; piece.clusters > 0; ++piece.cluster, --piece.clusters) {
    const Cluster& cluster = clusters_[cluster_order_[piece.cluster]];
    std::iota(to, to + cluster.count, cluster.begin);
    to += cluster.count;
  }
}

// Takes the first part off a piece and returns it.
BulkBuilder::Piece BulkBuilder::takeHalf(Piece& piece) {
  if (piece.count <= kMostOneByOne) layOut(piece);
  const bool by_cluster = piece.clusters > 0;
  const Half half = by_cluster ? split(cluster_order_ + piece.cluster, piece.clusters, piece.count, Clusters{clusters_})
                               : split(order_ + piece.begin, piece.count, piece.count, Triangles{items_});
  const std::uint32_t clusters = by_cluster ? half.items : 0;
  const Piece first{piece.begin, half.triangles, piece.cluster, clusters};
  piece = {piece.begin + half.triangles, piece.count - half.triangles, piece.cluster + clusters,
           piece.clusters - clusters};
  return first;
}

std::uint32_t BulkBuilder::addBlock(const Piece& piece) {
  Piece parts[8] = {piece};
  std::uint32_t count = 1;
  while (count < 8) {
    Piece* largest = nullptr;
    for (Piece& part : parts) {
      if (part.count > (largest != nullptr ? largest->count : 0) && part.count > kSmallPiece) largest = &part;
    }
    if (largest == nullptr) break;
    parts[count] = takeHalf(*largest);
    ++count;
  }
  const auto number = static_cast<std::uint32_t>(blocks_.size());
  blocks_.emplace_back();
  blocks_[number].lanes = count;
  for (std::uint32_t o = 0; o < count; ++o) {
    const bool is_leaf = parts[o].count <= kMaxLeafTriangles;
    if (is_leaf) layOut(parts[o]);
    const std::uint32_t child = is_leaf ? kNone : addBlock(parts[o]);
    blocks_[number].lane[o] = {parts[o].begin, parts[o].count, child};
  }
  return number;
}

CornerRows BulkBuilder::rows() const {
  CornerRows rows;
  for (std::size_t k = 0; k < 9; ++k) rows.row[k] = rows_ + k * (count_ + kRowPad);
  return rows;
}

PieceBounds BulkBuilder::boundsOf(std::uint32_t begin, std::uint32_t count) const {
  PieceBounds b = boundPiece(rows(), begin, count);
  Eigen::Map<V4>(b.lo) = load(b.lo).max(least_);
  Eigen::Map<V4>(b.hi) = load(b.hi).min(most_);
  return b;
}

// Children come after their parents, so one backward pass sees them first.
void BulkBuilder::boundBlocks() {
  const CornerRows rows = this->rows();
  block_bounds_.resize(blocks_.size());
  const double margin = marginOf(size_);
  for (std::size_t number = blocks_.size(); number-- > 0;) {
    Block& block = blocks_[number];
    PieceBounds lanes[8], &own = block_bounds_[number];
    for (std::uint32_t o = 0; o < block.lanes; ++o) {
      const Lane& lane = block.lane[o];
      lanes[o] = lane.block == kNone ? boundsOf(lane.begin, lane.count) : block_bounds_[lane.block];
      if (o == 0) {
        own = lanes[0];
        continue;
      }
      Eigen::Map<V4>(own.lo) = load(own.lo).min(load(lanes[o].lo));
      Eigen::Map<V4>(own.hi) = load(own.hi).max(load(lanes[o].hi));
      const float(&n)[3] = lanes[o].normal;
      const float sign = n[0] * own.normal[0] + n[1] * own.normal[1] + n[2] * own.normal[2] < 0 ? -1.0f : 1.0f;
      for (int k = 0; k < 3; ++k) own.normal[k] += sign * n[k];
    }
    const auto corner = [&](const float(&at)[4], double shift, double(&out)[3]) {
      for (int k = 0; k < 3; ++k) out[k] = static_cast<double>(at[k]) + base_[k] + shift;
    };
    double lo[3], hi[3];
    corner(own.lo, -margin, lo);
    corner(own.hi, margin, hi);
    block.frame = bounds::LooseFrame::of(lo, hi);
    std::uint32_t count = 0;
    for (std::uint32_t o = 0; o < block.lanes; ++o) count += block.lane[o].count;
    for (std::uint32_t o = 0; o < block.lanes; ++o) {
      if (count > kMostInSupportPiece && block.lane[o].count <= kMostInSupportPiece) {
        support_pieces_.push_back({block.lane[o].begin, block.lane[o].count, lanes[o]});
      }
      bounds::NodeBounds& b = block.bounds[o];
      corner(lanes[o].lo, -margin, lo);
      corner(lanes[o].hi, margin, hi);
      block.frame.encodeBox(lo, hi, b);
      std::int8_t normal[3];
      if (block.lane[o].count > kMostInSlab || !encodeNormal(lanes[o].normal, normal)) continue;
      const float n[3] = {static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])};
      float least, most;
      extremesAlong(rows, block.lane[o].begin, block.lane[o].count, n, least, most);
      double middle = 0;
      for (std::size_t k = 0; k < 3; ++k) middle += normal[k] * (block.frame.middle(b, k) - base_[static_cast<int>(k)]);
      const double off = bounds::kMostNormalNorm1 * margin;
      block.frame.encodeSlab(normal, static_cast<double>(least) - middle - off,
                             static_cast<double>(most) - middle + off, b);
    }
  }
}

std::size_t BulkBuilder::pack(std::uint32_t begin, std::uint32_t count, PackedTriangles::Words& words) const {
  if (size_ > kMostOnGrid) return 0;
  const float base[3] = {static_cast<float>(base_[0]), static_cast<float>(base_[1]), static_cast<float>(base_[2])};
  return PackedTriangles::pack(rows(), begin, count, base, words);
}

// Calls f with the pieces that supports are sought by.
template <typename F>
void BulkBuilder::withSupportPieces(F&& f) const {
  const std::size_t stride = support_pieces_.size() + kRowPad;
  std::vector<float> center(3 * stride, 0), half(3 * stride, -kInfinity);
  std::vector<std::array<std::uint32_t, 2>> pieces;
  for (std::size_t i = 0; i < support_pieces_.size(); ++i) {
    const PieceBounds& b = support_pieces_[i].bounds;
    pieces.push_back({support_pieces_[i].begin, support_pieces_[i].count});
    for (std::size_t c = 0; c < 3; ++c) {
      center[c * stride + i] = (b.lo[c] + b.hi[c]) / 2;
      half[c * stride + i] = (b.hi[c] - b.lo[c]) / 2;
    }
  }
  f(BoundedPieces{pieces.data(), pieces.size(), stride, center.data(), half.data()});
}

void BulkBuilder::findSupports(SupportTable& supports) const {
  const CornerRows rows = this->rows();
  const double margin = 3 * marginOf(size_);
  const Eigen::Vector3d base = base_.array() - lattice::kMiddle;
  withSupportPieces([&](const BoundedPieces& pieces) {
    for (int number = 0; number < SupportTable::kCount; ++number) {
      const Eigen::Vector3d direction = SupportTable::direction(number);
      const float n[3] = {static_cast<float>(direction[0]), static_cast<float>(direction[1]),
                          static_cast<float>(direction[2])};
      const auto most = static_cast<double>(farthestAlong(rows, pieces, n));
      supports.lower(number, most + direction.dot(base) + margin);
    }
  });
}

Eigen::Matrix3d BulkBuilder::principalAxes() const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Eigen::Matrix3d products = Eigen::Matrix3d::Zero();
  constexpr std::size_t kFew = 256;         // sums of more would be lost in float
  constexpr std::size_t kEnough = 1 << 12;  // the axes of this many are as good as those of all
  const std::size_t step = 1 + place_count_ / kEnough;
  for (std::size_t begin = 0; begin < place_count_; begin += kFew * step) {
    V4 first = all(0), square = all(0), turned = all(0);
    for (std::size_t i = begin; i < std::min(begin + kFew * step, place_count_); i += step) {
      const V4 p = Eigen::Map<const V4>(places_ + 4 * i);
      first += p;
      square += p * p;
      turned += p * V4(p[1], p[2], p[0], 0);
    }
    sum += first.head<3>().matrix().cast<double>();
    for (int k = 0; k < 3; ++k) {
      products(k, k) += static_cast<double>(square[k]);
      products(k, (k + 1) % 3) += static_cast<double>(turned[k]);
      products((k + 1) % 3, k) += static_cast<double>(turned[k]);
    }
  }
  const auto count = static_cast<double>((place_count_ + step - 1) / step);
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(products / count - sum * sum.transpose() / (count * count))
      .eigenvectors();
}

Outline::Box BulkBuilder::findOutline(const lattice::Lattice& lattice) const {
  const CornerRows rows = this->rows();
  Outline::Box best;
  double best_area = std::numeric_limits<double>::infinity();
  withSupportPieces([&](const BoundedPieces& pieces) {
    for (const Eigen::Matrix3d& axes : {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), principalAxes()}) {
      if (!axes.allFinite()) continue;
      Eigen::Vector3d center = base_, half;
      for (int k = 0; k < 3; ++k) {
        double ends_at[2];
        for (const int sign : {-1, 1}) {
          float n[3];
          for (int c = 0; c < 3; ++c) n[c] = static_cast<float>(sign * axes(c, k));
          ends_at[sign > 0] = sign * (static_cast<double>(farthestAlong(rows, pieces, n)) + 3 * marginOf(size_));
        }
        center += axes.col(k) * (ends_at[0] + ends_at[1]) / 2;
        half[k] = (ends_at[1] - ends_at[0]) / 2;
      }
      const double area = half[0] * half[1] + half[1] * half[2] + half[2] * half[0];
      if (!(area < best_area)) continue;
      best_area = area;
      best = Outline::boxOf(lattice.origin() + lattice.unit() * center, axes, lattice.unit() * half);
    }
  });
  return best;
}

void BulkBuilder::finish(const Mesh::Indices* indices, const std::uint32_t* numbers) {
  own_ = Own();
  support_pieces_.clear();
  if (ids_.empty()) return;
  gatherCorners(indices, places_, numbers, count_, rows_, count_ + kRowPad);
  boundBlocks();
  const auto count = static_cast<std::uint32_t>(ids_.size());
  const PieceBounds bounds = blocks_.empty() ? boundsOf(0, count) : block_bounds_[0];
  if (support_pieces_.empty()) support_pieces_.push_back({0, count, bounds});
  const double margin = marginOf(size_);
  for (int k = 0; k < 3; ++k) {
    own_.box.min()[k] = static_cast<double>(bounds.lo[k]) + base_[k] - margin;
    own_.box.max()[k] = static_cast<double>(bounds.hi[k]) + base_[k] + margin;
  }
  if (count > kMostInSlab || !encodeNormal(bounds.normal, own_.normal)) return;
  const CornerRows rows = this->rows();
  float n[3], least, most;
  for (int k = 0; k < 3; ++k) n[k] = static_cast<float>(own_.normal[k]);
  extremesAlong(rows, 0, count, n, least, most);
  double base = 0;
  for (int k = 0; k < 3; ++k) base += own_.normal[k] * base_[k];
  own_.least = static_cast<double>(least) + base - bounds::kMostNormalNorm1 * margin;
  own_.most = static_cast<double>(most) + base + bounds::kMostNormalNorm1 * margin;
}

}  // namespace bocst::tree
