// SPDX-License-Identifier: BSD-3-Clause
#include "tree/root_grid.h"

#include <algorithm>
#include <cstring>

#include "memory/huge_pages.h"
#include "oracle/reference.h"
#include "thread/of_thread.h"

namespace bocst::tree {
namespace {

constexpr std::uint32_t kNone = 0x7f7f7f7fu;  // more triangles than a grid is made for; of equal bytes, so quickly set
constexpr std::size_t kSmallest = 4096;       // triangles: below, plain expansions are as fast
constexpr std::size_t kLargeShare = 256;      // at most one triangle in this many may span more than two cells
constexpr double kMargin = 2;                 // lattice units: one step
constexpr std::size_t kBlock = 256;           // triangles that are linked at once

std::size_t inWholeGroups(std::size_t triangles) { return (triangles + 7) / 8 * 8; }

/// Memory for the arrays from which one grid is made.
class ScratchMemory {
 public:
  // Fresh memory costs as much as what is written to it, so a thread keeps some, one MB at most, for its next mesh.
  explicit ScratchMemory(std::size_t bytes) {
    if (bytes > kMostKept) {
      own_ = memory::HugePages(bytes);
      begin_ = static_cast<std::byte*>(own_.begin());
      return;
    }
    struct Allocation {
      std::unique_ptr<std::byte[]> bytes;
      std::size_t size = 0;
    };
    Allocation& allocation = thread::ofThread<Allocation>();
    if (allocation.size < bytes) {
      allocation.bytes.reset(new std::byte[bytes]);
      allocation.size = bytes;
    }
    begin_ = allocation.bytes.get();
  }

  /// The next `count` of them, with any values.
  template <typename T>
  T* take(std::size_t count) {
    T* const values = new (begin_) T[count];
    begin_ += count * sizeof(T);
    return values;
  }

 private:
  static constexpr std::size_t kMostKept = 1 << 20;

  memory::HugePages own_;
  std::byte* begin_;
};

/// The vertices in steps of two lattice units.
class QuantisedMesh {
 public:
  static std::size_t values(const oracle::Surface& surface) { return 3 * surface.mesh->vertexCount() + 1; }

  QuantisedMesh(const oracle::Surface& surface, int bits, std::int16_t* room)
      : triangles_(surface.mesh->triangles().data()), bits_(bits), vertices_(room) {
    const Mesh& mesh = *surface.mesh;
    // Leaves room for a step of margin on both sides.
    quantise(mesh.vertices().data()->data(), mesh.vertexCount(), surface.lattice.origin().data(),
             surface.lattice.inverseUnit() / kMargin, (1 << kGridSpanBits) - 2, vertices_);
    vertices_[values(surface) - 1] = 0;
  }

  /// Of `count` triangles from t on. One step of margin covers the rounding of toLattice and closed cells that only
  /// touch.
  void spans(std::size_t t, std::size_t count, GridSpan* out) const {
    gridSpans(vertices_, triangles_[t].data(), count, bits_, out);
  }

  /// The first and the last cell of a triangle's box along each axis.
  void box(std::size_t t, std::uint32_t first[3], std::uint32_t last[3]) const {
    const int shift = kGridSpanBits - bits_;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = [&](std::size_t corner) { return vertices_[3 * std::size_t{triangles_[t][corner]} + k]; };
      const std::int16_t a = at(0), b = at(1), c = at(2);
      first[k] = static_cast<std::uint32_t>(std::min({a, b, c}) - 1) >> shift;
      last[k] = static_cast<std::uint32_t>(std::max({a, b, c}) + 1) >> shift;
    }
  }

 private:
  const Mesh::Indices* triangles_;
  const int bits_;
  std::int16_t* vertices_;
};

}  // namespace

std::unique_ptr<RootGrid> RootGrid::make(const oracle::Surface& surface, int max_level) {
  const std::size_t count = surface.mesh->triangleCount();
  if (count < kSmallest || count >= kNone) return nullptr;
  const int bits = std::min(count < 10000 ? 3 : count < 300000 ? 4 : 5, max_level - 1);
  // A coarser grid suits larger triangles.
  for (int b = bits; b >= 3; --b) {
    std::unique_ptr<RootGrid> grid(new RootGrid(b));
    if (grid->build(surface)) return grid;
  }
  return nullptr;
}

bool RootGrid::build(const oracle::Surface& surface) {
  const std::size_t count = surface.mesh->triangleCount(), most_large = count / kLargeShare;
  const std::size_t lists = std::size_t{8} << 3 * bits_;
  ScratchMemory room(lists * sizeof(std::uint32_t) + QuantisedMesh::values(surface) * sizeof(std::int16_t) + lists / 8);
  auto* const heads = room.take<std::uint32_t>(lists);
  std::memset(heads, kNone & 0xff, lists * sizeof(*heads));
  const QuantisedMesh mesh(surface, bits_, room.take<std::int16_t>(QuantisedMesh::values(surface)));
  back_.reset(new std::uint16_t[inWholeGroups(count)]);
  memory::adviseHugePages(back_.get(), count * sizeof(back_[0]));
  triangle_count_ = count;
  GridSpan spans[kBlock];
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    mesh.spans(begin, size, spans);
    link(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(begin + size), spans, heads);
    if (large_.size() > most_large) return false;
  }

  keepLists(heads, room.take<std::uint8_t>(lists / 8));
  may_be_grey_.assign(word(bits_ + 1, 0, 0), 0);
  is_grey_.assign(may_be_grey_.size(), 0);
  markCells();
  for (const std::uint32_t t : large_) {
    std::uint32_t first[3], last[3];
    mesh.box(t, first, last);
    const std::uint32_t along_x = ~0u >> (31 - (last[0] - first[0])) << first[0];
    for (std::uint32_t z = first[2]; z <= last[2]; ++z) {
      for (std::uint32_t y = first[1]; y <= last[1]; ++y) may_be_grey_[word(bits_, y, z)] |= along_x;
    }
  }
  dropMissingCells(surface);
  markCoarseCells();
  return true;
}

void RootGrid::link(std::uint32_t begin, std::uint32_t end, const GridSpan* spans, std::uint32_t* heads) {
  const std::uint32_t first_large = kGridSpanLarge << 3 * bits_;
  std::uint32_t next[kBlock] = {};
#pragma GCC unroll 4
  for (std::uint32_t t = begin; t < end; ++t) {
    const auto list = static_cast<std::uint32_t>(*spans++);
    if (list >= first_large) {
      large_.push_back(std::uint32_t{t});
      next[t - begin] = kNone;
      continue;
    }
    next[t - begin] = heads[list];
    heads[list] = t;
  }
  if (!stepsBack(next, begin, end - begin, &back_[begin])) return;
  for (std::uint32_t t = begin; t < end; ++t) {
    if (next[t - begin] != kNone && t - next[t - begin] >= kFar) far_.push_back({t, next[t - begin]});
  }
}

std::uint32_t RootGrid::farNext(std::uint32_t triangle) const {
  const auto is_before = [](const Far& f, std::uint32_t t) { return f.triangle < t; };
  return std::lower_bound(far_.begin(), far_.end(), triangle, is_before)->next;
}

void RootGrid::keepLists(const std::uint32_t* heads, std::uint8_t* bits) {
  const std::size_t side = std::size_t{1} << bits_, bytes = side / 8;
  rows_.resize(8 * side * side);
  bitsOfOthers(heads, rows_.size() * side, kNone, bits);
  std::uint32_t count = 0;
  for (Row& row : rows_) {
    row = {0, count};
    for (std::size_t k = 0; k < bytes; ++k) row.lists |= std::uint32_t{*bits++} << 8 * k;
    count += static_cast<std::uint32_t>(__builtin_popcount(row.lists));
  }
  head_.resize(count);
  std::uint32_t* head = head_.data();
  for (const Row& row : rows_) {
    for (std::uint32_t left = row.lists; left != 0; left &= left - 1) *head++ = heads[__builtin_ctz(left)];
    heads += side;
  }
}

void RootGrid::markCells() {
  const std::size_t side = std::size_t{1} << bits_;
  for (std::size_t z = 0; z < side; ++z) {
    for (std::size_t y = 0; y < side; ++y) {
      std::uint32_t reached[8];
      for (unsigned q = 0; q < 8; ++q) reached[q] = rows_[row(q, y, z)].lists;
      is_grey_[word(bits_, y, z)] = reached[0];
      // What reaches the next cell on some axes does so on fewer.
      for (unsigned axis = 1; axis < 8; axis *= 2) {
        for (unsigned q = 0; q < 8; ++q) {
          if ((q & axis) == 0) reached[q] |= reached[q | axis];
        }
      }
      for (unsigned q = 0; q < 8; ++q) {
        if (reached[q] != 0) may_be_grey_[word(bits_, y + (q >> 1 & 1), z + (q >> 2))] |= reached[q] << (q & 1);
      }
    }
  }
}

void RootGrid::dropMissingCells(const oracle::Surface& surface) {
  const std::uint32_t side = 1u << bits_, unit = lattice::Cell{level(), {}}.side();
  const auto& extent = surface.lattice.extent();
  const auto cells = [&](std::size_t k) { return (extent[k] + unit - 1) / unit; };
  const std::uint32_t along_x = ~0u >> (32 - cells(0));
  for (std::uint32_t z = 0; z < side; ++z) {
    for (std::uint32_t y = 0; y < side; ++y) {
      const std::uint32_t keep = y < cells(1) && z < cells(2) ? along_x : 0;
      may_be_grey_[word(bits_, y, z)] &= keep;
      is_grey_[word(bits_, y, z)] &= keep;
    }
  }
}

void RootGrid::markCoarseCells() {
  const auto halved = [](std::uint32_t bits) {
    bits = (bits | bits >> 1) & 0x55555555u;
    bits = (bits | bits >> 1) & 0x33333333u;
    bits = (bits | bits >> 2) & 0x0f0f0f0fu;
    bits = (bits | bits >> 4) & 0x00ff00ffu;
    return (bits | bits >> 8) & 0x0000ffffu;
  };
  for (int b = bits_ - 1; b >= 1; --b) {
    const std::size_t side = std::size_t{1} << b;
    for (std::size_t z = 0; z < side; ++z) {
      for (std::size_t y = 0; y < side; ++y) {
        for (Bits* bits : {&may_be_grey_, &is_grey_}) {
          std::uint32_t* const fine = &(*bits)[word(b + 1, 2 * y, 2 * z)];
          (*bits)[word(b, y, z)] = halved(fine[0] | fine[1] | fine[2 * side] | fine[2 * side + 1]);
        }
      }
    }
  }
}

bool RootGrid::grey(const oracle::Surface& surface, const lattice::Cell& cell) {
  const std::size_t w = word(cell.level - 1, cell.at[1], cell.at[2]);
  const std::uint32_t bit = 1u << cell.at[0];
  if ((may_be_grey_[w] & bit) == 0 || (is_grey_[w] & bit) != 0) return (may_be_grey_[w] & bit) != 0;
  const bool is_grey = decide(surface, cell);
  if (is_grey) {
    is_grey_[w] |= bit;
  } else {
    may_be_grey_[w] &= ~bit;
  }
  return is_grey;
}

bool RootGrid::decide(const oracle::Surface& surface, const lattice::Cell& cell) {
  if (cell.level < level()) {
    for (int o = 0; o < 8; ++o) {
      if (grey(surface, cell.octant(o))) return true;
    }
    return false;
  }
  const double half = cell.side() / 2.0;
  const auto corner = cell.corner();
  const Eigen::Vector3d center(corner[0] + half, corner[1] + half, corner[2] + half);
  return anyCandidate(surface, cell, [&](std::uint32_t t) {
    return oracle::triangleMeetsCube(surface.corners(t).data(), center, half);
  });
}

Eigen::AlignedBox3d RootGrid::bounds(const lattice::Cell& cell) const {
  const int down = level() - cell.level;
  const std::uint32_t width = 1u << down, unit = cell.side() >> down;
  const std::uint32_t x = cell.at[0] * width, y = cell.at[1] * width, z = cell.at[2] * width;
  const std::uint32_t row = ~0u >> (32 - width);
  std::uint32_t along_x = 0, along_y = 0, along_z = 0;
  for (std::uint32_t k = 0; k < width; ++k) {
    const std::uint32_t* const words = &may_be_grey_[word(bits_, y, z + k)];
    std::uint32_t layer = 0;
    for (std::uint32_t j = 0; j < width; ++j) {
      const std::uint32_t bits = words[j] >> x & row;
      layer |= bits;
      along_y |= std::uint32_t{bits != 0} << j;
    }
    along_x |= layer;
    along_z |= std::uint32_t{layer != 0} << k;
  }
  const auto first = [](std::uint32_t bits) { return __builtin_ctz(bits); };
  const auto end = [](std::uint32_t bits) { return 32 - __builtin_clz(bits); };
  const Eigen::Vector3d corner(x, y, z);
  return {(corner + Eigen::Vector3d(first(along_x), first(along_y), first(along_z))) * unit,
          (corner + Eigen::Vector3d(end(along_x), end(along_y), end(along_z))) * unit};
}

// Calls f for each triangle that may meet a cell of the finest level, until one returns true.
template <typename F>
bool RootGrid::anyCandidate(const oracle::Surface& surface, const lattice::Cell& cell, F&& f) const {
  for (unsigned q = 0; q < 8; ++q) {
    std::array<std::uint32_t, 3> from = cell.at;
    bool outside = false;
    for (unsigned k = 0; k < 3; ++k) {
      if ((q >> k & 1) == 0) continue;
      outside |= from[k] == 0;
      --from[k];
    }
    if (outside) continue;
    // What starts in this cell meets it; what starts in a neighbour has to reach it on the axes between them.
    std::uint32_t heads[8];
    int count = 0;
    for (unsigned p = q; p < 8; p = (p + 1) | q) {
      const Row& r = rows_[row(p, from[1], from[2])];
      const std::uint32_t bit = 1u << from[0];
      if ((r.lists & bit) != 0) heads[count++] = head_[r.first + __builtin_popcount(r.lists & (bit - 1))];
    }
    // Each list goes from the last triangle to the first; so does what they are together.
    while (count > 0) {
      int last = 0;
      for (int i = 1; i < count; ++i) last = heads[i] > heads[last] ? i : last;
      const std::uint32_t t = heads[last];
      const std::uint32_t back = back_[t];
      heads[last] = back != kFar ? t - back : farNext(t);
      if (back == 0) heads[last] = heads[--count];
      if (f(t)) return true;
    }
  }
  if (large_.empty()) return false;
  const Mesh& mesh = *surface.mesh;
  const Eigen::Vector3d& origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  const auto at = [&](std::uint32_t vertex, int k) { return (mesh.vertex(vertex)[k] - origin[k]) * inverse_unit; };
  double lo[3], hi[3];
  for (std::size_t k = 0; k < 3; ++k) {
    lo[k] = cell.corner()[k] - kMargin;
    hi[k] = lo[k] + cell.side() + 2 * kMargin;
  }
  for (const std::uint32_t t : large_) {
    const Mesh::Indices& i = mesh.indices(t);
    bool meets = true;
    for (int k = 0; k < 3; ++k) {
      const double a = at(i[0], k), b = at(i[1], k), c = at(i[2], k);
      meets &= std::min(std::min(a, b), c) <= hi[k] && std::max(std::max(a, b), c) >= lo[k];
    }
    if (meets && f(t)) return true;
  }
  return false;
}

void RootGrid::gather(const oracle::Surface& surface, const lattice::Cell& cell,
                      std::vector<std::uint32_t>& ids) const {
  anyCandidate(surface, cell, [&ids](std::uint32_t t) {
    ids.push_back(t);
    return false;
  });
}

std::size_t RootGrid::bytes() const {
  return sizeof(*this) + rows_.capacity() * sizeof(Row) + inWholeGroups(triangle_count_) * sizeof(back_[0]) +
         far_.capacity() * sizeof(Far) +
         (head_.capacity() + large_.capacity() + may_be_grey_.capacity() + is_grey_.capacity()) * sizeof(head_[0]);
}

}  // namespace bocst::tree
