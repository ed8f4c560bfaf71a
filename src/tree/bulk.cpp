// SPDX-License-Identifier: BSD-3-Clause
#include "tree/bulk.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tree/bulk_kernels.h"

namespace bocst::tree {
namespace {

using V4 = Eigen::Array4f;  // three coordinates and bits that nobody computes with, in one register

// Chosen by build time and by `bench --scenarios fresh`: 8 to 16 and 32 to 256 differ by less than 10 %.
constexpr std::uint32_t kSmallPiece = 12;  // is not divided further where a block has lanes left
constexpr std::uint32_t kMostSorted = 64;  // larger pieces are divided by their keys, which costs nothing
constexpr std::size_t kMostInSlab = 4096;  // above, the surface is no slab and the pass over it is long
constexpr int kBins = 8;
constexpr int kKeyBits = 10;  // along each axis
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::size_t kRowPad = 16;  // kernels read whole vectors

V4 load(const float (&values)[4]) { return Eigen::Map<const V4>(values); }
V4 all(float x) { return V4::Constant(x); }

float areaOf(const V4& lo, const V4& hi) {
  const V4 e = hi - lo;
  return e[0] * e[1] + e[1] * e[2] + e[2] * e[0];
}

float fromBits(std::uint32_t bits) {
  float x;
  std::memcpy(&x, &bits, sizeof(x));
  return x;
}

std::uint32_t bitsOf(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  return bits;
}

// Every third bit.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 16) & 0x030000ffu;
  x = (x | x << 8) & 0x0300f00fu;
  x = (x | x << 4) & 0x030c30c3u;
  return (x | x << 2) & 0x09249249u;
}

// What float coordinates no larger than `size` are off by, and sums of products of three of them with bytes of a normal
// in multiples of 3 * 127.
double marginOf(float size) { return 8 * 0x1p-24 * static_cast<double>(size); }

}  // namespace

void BulkBuilder::build(const oracle::Surface& surface, const std::uint32_t* ids, std::size_t count,
                        const Eigen::AlignedBox3d& region) {
  items_.clear();
  base_ = region.min().array().floor();
  const Eigen::Vector3d lo = region.min() - base_, hi = region.max() - base_;
  least_ << (lo.array() - 0.01).cast<float>(), -kInfinity;
  most_ << (hi.array() + 0.01).cast<float>(), kInfinity;
  size_ = 0;
  const Eigen::Vector3d origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  const Mesh& mesh = *surface.mesh;
  const auto place = [&](std::uint32_t v) {
    const Eigen::Vector3d p = (mesh.vertex(v) - origin) * inverse_unit - base_;
    return V4(static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2]), 0.0f);
  };
  for (std::size_t i = 0; i < count; ++i) {
    const Mesh::Indices& v = mesh.indices(ids[i]);
    addItem(place(v[0]), place(v[1]), place(v[2]), ids[i]);
  }
  sorted_ = false;
  blocks_.clear();
  if (items_.size() > kMaxLeafTriangles) addBlock({0, static_cast<std::uint32_t>(items_.size())});
  fillRows(surface, false);
  finish();
}

void BulkBuilder::buildAll(const oracle::Surface& surface) {
  items_.clear();
  const Mesh& mesh = *surface.mesh;
  const std::size_t vertices = mesh.vertexCount(), count = mesh.triangleCount();
  base_.setConstant(lattice::kMiddle);
  least_.setConstant(-kInfinity);
  most_.setConstant(kInfinity);
  size_ = 0;
  items_.reserve(count);
  const Eigen::Vector3d origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  places_.resize(4 * vertices);
  for (std::size_t v = 0; v < vertices; ++v) {
    const Eigen::Vector3d& p = mesh.vertex(static_cast<std::uint32_t>(v));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto c = static_cast<int>(k);
      places_[4 * v + k] = static_cast<float>((p[c] - origin[c]) * inverse_unit - base_[c]);
    }
    places_[4 * v + 3] = 0;
  }
  const auto place = [this](std::uint32_t v) { return V4(Eigen::Map<const V4>(&places_[4 * std::size_t{v}])); };
  for (std::uint32_t t = 0; t < count; ++t) {
    const Mesh::Indices& i = mesh.indices(t);
    addItem(place(i[0]), place(i[1]), place(i[2]), t);
  }
  sortItems();
  sorted_ = true;
  blocks_.clear();
  if (count > kMaxLeafTriangles) addBlock({0, static_cast<std::uint32_t>(count)});
  fillRows(surface, true);
  finish();
}

void BulkBuilder::addItem(const V4& a, const V4& b, const V4& c, std::uint32_t id) {
  const V4 lo = a.min(b).min(c), hi = a.max(b).max(c);
  size_ = std::max(size_, lo.abs().max(hi.abs()).maxCoeff());
  const V4 inner_lo = lo.max(least_), inner_hi = hi.min(most_);
  if ((inner_lo > inner_hi).any()) return;
  items_.emplace_back();
  Item& item = items_.back();
  Eigen::Map<V4>(item.lo) = inner_lo;
  Eigen::Map<V4>(item.hi) = inner_hi;
  item.lo[3] = fromBits(id);
}

// By the middles of their boxes along a Z-order curve over the root cube: three passes of ten bits.
void BulkBuilder::sortItems() {
  constexpr std::size_t kBuckets = 1 << kKeyBits;
  std::uint32_t starts[3][kBuckets] = {};
  const std::size_t count = items_.size();
  keys_.resize(count);
  const float step = static_cast<float>(1 << kKeyBits) / (4.0f * lattice::kMiddle);
  const V4 corner = all(2.0f * lattice::kMiddle), last = all((1 << kKeyBits) - 1.0f);
  for (std::uint32_t i = 0; i < count; ++i) {
    const V4 cell = ((load(items_[i].lo) + load(items_[i].hi) + corner) * step).max(0.0f).min(last);
    const std::uint32_t code = spread(static_cast<std::uint32_t>(cell[0])) |
                               spread(static_cast<std::uint32_t>(cell[1])) << 1 |
                               spread(static_cast<std::uint32_t>(cell[2])) << 2;
    keys_[i] = {code, i};
    for (int pass = 0; pass < 3; ++pass) ++starts[pass][code >> (kKeyBits * pass) & (kBuckets - 1)];
  }
  keys_room_.resize(count);
  for (int pass = 0; pass < 3; ++pass) {
    std::uint32_t sum = 0;
    for (std::uint32_t& start : starts[pass]) {
      const std::uint32_t size = start;
      start = sum;
      sum += size;
    }
    for (const Key& key : keys_) keys_room_[starts[pass][key.code >> (kKeyBits * pass) & (kBuckets - 1)]++] = key;
    keys_.swap(keys_room_);
  }
  items_room_.resize(count);
  for (std::size_t i = 0; i < count; ++i) items_room_[i] = items_[keys_[i].id];
  items_.swap(items_room_);
}

// Divides a piece in two; returns how many come first. A large one is divided where its keys first differ, so that a
// lane shares more of the key. A smaller one where the sum of areas times triangles is least, along the longest axis of
// the middles; neither part has less than an eighth, so that seven divisions of the largest leave less than half.
std::uint32_t BulkBuilder::split(Piece piece) {
  if (sorted_ && piece.count > kMostSorted) {
    const std::uint32_t differ = keys_[piece.begin].code ^ keys_[piece.begin + piece.count - 1].code;
    if (differ != 0) {
      const std::uint32_t bit = 1u << (31 - __builtin_clz(differ));
      const auto begin = keys_.begin() + piece.begin;
      return static_cast<std::uint32_t>(
          std::partition_point(begin, begin + piece.count, [bit](const Key& key) { return (key.code & bit) == 0; }) -
          begin);
    }
  }
  Item* const begin = items_.data() + piece.begin;
  Item* const end = begin + piece.count;
  V4 least = all(kInfinity), most = all(-kInfinity);
  for (const Item* i = begin; i != end; ++i) {
    const V4 twice = load(i->lo) + load(i->hi);
    least = least.min(twice);
    most = most.max(twice);
  }
  int axis = 0;
  for (int k = 1; k < 3; ++k) axis = most[k] - least[k] > most[axis] - least[axis] ? k : axis;
  const auto twiceMiddle = [axis](const Item& i) { return i.lo[axis] + i.hi[axis]; };
  const float extent = most[axis] - least[axis];
  const std::uint32_t half = piece.count / 2, few = std::max(piece.count / 8, 1u);
  if (!(extent > 0)) return half;

  const float first = least[axis], per = 0.9999f * kBins / extent;
  const auto binOf = [&](const Item& i) { return static_cast<int>((twiceMiddle(i) - first) * per); };
  V4 lo[kBins], hi[kBins];
  std::uint32_t counts[kBins] = {};
  for (int b = 0; b < kBins; ++b) lo[b] = all(kInfinity), hi[b] = all(-kInfinity);
  for (const Item* i = begin; i != end; ++i) {
    const int b = binOf(*i);
    lo[b] = lo[b].min(load(i->lo));
    hi[b] = hi[b].max(load(i->hi));
    ++counts[b];
  }
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
    if (count < few || piece.count - count < few) continue;
    const float cost = areaOf(box_lo, box_hi) * static_cast<float>(count) + after[b];
    if (cost < best_cost) best_cost = cost, best = b;
  }
  if (best == 0) {
    std::nth_element(begin, begin + half, end,
                     [&](const Item& x, const Item& y) { return twiceMiddle(x) < twiceMiddle(y); });
    return half;
  }
  return static_cast<std::uint32_t>(std::partition(begin, end, [&](const Item& i) { return binOf(i) < best; }) - begin);
}

std::uint32_t BulkBuilder::addBlock(Piece piece) {
  Piece parts[8] = {piece};
  std::uint32_t count = 1;
  while (count < 8) {
    Piece& largest =
        *std::max_element(parts, parts + count, [](const Piece& x, const Piece& y) { return x.count < y.count; });
    if (largest.count <= kSmallPiece) break;
    const std::uint32_t first = split(largest);
    parts[count++] = {largest.begin + first, largest.count - first};
    largest.count = first;
  }
  const auto number = static_cast<std::uint32_t>(blocks_.size());
  blocks_.emplace_back();
  blocks_[number].lanes = count;
  for (std::uint32_t o = 0; o < count; ++o) {
    const std::uint32_t child = parts[o].count <= kMaxLeafTriangles ? kNone : addBlock(parts[o]);
    blocks_[number].lane[o] = {parts[o].begin, parts[o].count, child};
  }
  return number;
}

void BulkBuilder::fillRows(const oracle::Surface& surface, bool all) {
  const std::size_t count = items_.size(), stride = count + kRowPad;
  ids_.resize(count);
  rows_.resize(9 * stride);
  const Mesh& mesh = *surface.mesh;
  const Eigen::Vector3d origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  for (std::size_t i = 0; i < count; ++i) {
    ids_[i] = bitsOf(items_[i].lo[3]);
    const Mesh::Indices& v = mesh.indices(ids_[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      if (all) {
        const float* const place = &places_[4 * std::size_t{v[k]}];
        for (std::size_t c = 0; c < 3; ++c) rows_[(3 * k + c) * stride + i] = place[c];
      } else {
        const Eigen::Vector3d p = (mesh.vertex(v[k]) - origin) * inverse_unit - base_;
        for (std::size_t c = 0; c < 3; ++c)
          rows_[(3 * k + c) * stride + i] = static_cast<float>(p[static_cast<int>(c)]);
      }
    }
  }
}

BulkBuilder::Bounds BulkBuilder::boundsOf(Piece piece) const {
  V4 lo = load(items_[piece.begin].lo), hi = load(items_[piece.begin].hi);
  for (std::uint32_t i = piece.begin + 1; i < piece.begin + piece.count; ++i) {
    lo = lo.min(load(items_[i].lo));
    hi = hi.max(load(items_[i].hi));
  }
  Bounds b;
  Eigen::Map<V4>(b.lo) = lo;
  Eigen::Map<V4>(b.hi) = hi;
  CornerRows rows;
  for (std::size_t k = 0; k < 9; ++k) rows.row[k] = rows_.data() + k * (items_.size() + kRowPad);
  sumNormals(rows, piece.begin, piece.count, b.normal);
  return b;
}

// Children come after their parents, so one backward pass sees them first.
void BulkBuilder::boundBlocks() {
  CornerRows rows;
  for (std::size_t k = 0; k < 9; ++k) rows.row[k] = rows_.data() + k * (items_.size() + kRowPad);
  block_bounds_.resize(blocks_.size());
  const double margin = marginOf(size_);
  for (std::size_t number = blocks_.size(); number-- > 0;) {
    Block& block = blocks_[number];
    Bounds lanes[8], &own = block_bounds_[number];
    for (std::uint32_t o = 0; o < block.lanes; ++o) {
      const Lane& lane = block.lane[o];
      lanes[o] = lane.block == kNone ? boundsOf({lane.begin, lane.count}) : block_bounds_[lane.block];
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
    for (std::uint32_t o = 0; o < block.lanes; ++o) {
      bounds::LooseBounds& b = block.bounds[o];
      corner(lanes[o].lo, -margin, lo);
      corner(lanes[o].hi, margin, hi);
      b.setBox(block.frame, lo, hi);
      std::int8_t normal[3];
      if (block.lane[o].count > kMostInSlab || !bounds::byteNormal(lanes[o].normal, normal)) continue;
      const float n[3] = {static_cast<float>(normal[0]), static_cast<float>(normal[1]), static_cast<float>(normal[2])};
      float least, most;
      extremesAlong(rows, block.lane[o].begin, block.lane[o].count, n, least, most);
      double middle = 0;
      for (std::size_t k = 0; k < 3; ++k) middle += normal[k] * (b.middle(block.frame, k) - base_[static_cast<int>(k)]);
      const double off = 3 * 127 * margin;
      b.setSlab(block.frame, normal, (static_cast<double>(least) - middle - off) / 127,
                (static_cast<double>(most) - middle + off) / 127);
    }
  }
}

void BulkBuilder::finish() {
  own_ = Own();
  if (items_.empty()) return;
  boundBlocks();
  const Piece whole{0, static_cast<std::uint32_t>(items_.size())};
  const Bounds bounds = blocks_.empty() ? boundsOf(whole) : block_bounds_[0];
  const double margin = marginOf(size_);
  for (int k = 0; k < 3; ++k) {
    own_.box.min()[k] = static_cast<double>(bounds.lo[k]) + base_[k] - margin;
    own_.box.max()[k] = static_cast<double>(bounds.hi[k]) + base_[k] + margin;
  }
  if (whole.count > kMostInSlab || !bounds::byteNormal(bounds.normal, own_.normal)) return;
  CornerRows rows;
  for (std::size_t k = 0; k < 9; ++k) rows.row[k] = rows_.data() + k * (items_.size() + kRowPad);
  float n[3], least, most;
  for (int k = 0; k < 3; ++k) n[k] = static_cast<float>(own_.normal[k]);
  extremesAlong(rows, 0, whole.count, n, least, most);
  double base = 0;
  for (int k = 0; k < 3; ++k) base += own_.normal[k] * base_[k];
  own_.least = static_cast<double>(least) + base - 3 * 127 * margin;
  own_.most = static_cast<double>(most) + base + 3 * 127 * margin;
}

}  // namespace bocst::tree
