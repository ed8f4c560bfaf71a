// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/root_grid.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "oracle/cpu/clip.h"
#include "oracle/cpu/kernels.h"
#include "oracle/reference.h"

namespace bocst::oracle {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr std::size_t kSmallest = 4096;   // triangles: below, plain expansions are as fast
constexpr std::size_t kLargeShare = 256;  // at most one triangle in so many may span more than two cells
constexpr double kMargin = 2;             // lattice units: one step
constexpr int kAxesShift = 28;            // of the links of lists; a mesh has at most 2^28 triangles
constexpr std::uint32_t kTriangle = (1u << kAxesShift) - 1;

constexpr std::size_t bucketOf(GridSpan s) { return s & 0xffff; }
constexpr std::size_t reachOf(GridSpan s) { return s >> 16 & 0x3f; }
constexpr bool isLarge(GridSpan s) { return (reachOf(s) & 0x2a) != 0; }

/// What a reach without a 2 means: the axes as a link has them, and their bit among the patterns.
struct Reach {
  std::uint32_t axes[64] = {};
  std::uint8_t pattern[64] = {};

  constexpr Reach() {
    for (std::uint32_t r = 0; r < 64; ++r) {
      const std::uint32_t q = (r & 1) | (r >> 1 & 2) | (r >> 2 & 4);
      axes[r] = q << kAxesShift;
      pattern[r] = static_cast<std::uint8_t>(1 << q);
    }
  }
};
constexpr Reach kReach;

/// The vertices in steps of two lattice units.
class QuantisedMesh {
 public:
  QuantisedMesh(const Surface& surface, int bits) : triangles_(surface.mesh->triangles().data()), bits_(bits) {
    const Mesh& mesh = *surface.mesh;
    vertices_ = room(3 * mesh.vertexCount() + 1);
    // Room for a step of margin on both sides.
    quantise(mesh.vertices().data()->data(), mesh.vertexCount(), surface.lattice.origin().data(),
             surface.lattice.inverseUnit() / kMargin, (1 << kGridSpanBits) - 2, vertices_);
    vertices_[3 * mesh.vertexCount()] = 0;
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
  // Fresh memory costs as much as what is written to it, so a thread keeps some, one MB at most, for its next mesh.
  std::int16_t* room(std::size_t count) {
    struct Kept {
      std::unique_ptr<std::int16_t[]> values;
      std::size_t count = 0;
    };
    thread_local Kept kept;
    const bool keep = count <= kMostKept;
    if (keep && kept.count >= count) return kept.values.get();
    std::unique_ptr<std::int16_t[]>& values = keep ? kept.values : own_;
    values.reset(new std::int16_t[count]);
    if (keep) kept.count = count;
    return values.get();
  }

  static constexpr std::size_t kMostKept = 1 << 19;

  const Mesh::Indices* triangles_;
  const int bits_;
  std::unique_ptr<std::int16_t[]> own_;
  std::int16_t* vertices_;
};

// Of the eight patterns of axes, those that have all the axes of q.
constexpr std::uint8_t kReaching[8] = {0xff, 0xaa, 0xcc, 0x88, 0xf0, 0xa0, 0xc0, 0x80};

}  // namespace

std::unique_ptr<RootGrid> RootGrid::make(const Surface& surface, int max_level) {
  const std::size_t count = surface.mesh->triangleCount();
  if (count < kSmallest) return nullptr;
  const int bits = std::min(count < 10000 ? 3 : count < 300000 ? 4 : 5, max_level - 1);
  // A coarser grid suits larger triangles.
  for (int b = bits; b >= 3; --b) {
    std::unique_ptr<RootGrid> grid(new RootGrid(b));
    if (grid->build(surface)) return grid;
  }
  return nullptr;
}

bool RootGrid::build(const Surface& surface) {
  const std::size_t count = surface.mesh->triangleCount(), most_large = count / kLargeShare;
  const QuantisedMesh mesh(surface, bits_);
  head_.assign(std::size_t{1} << 3 * bits_, kNone);
  next_.reset(new std::uint32_t[count]);
  triangle_count_ = count;
  reaches_.assign(head_.size(), 0);
  std::uint32_t *const head = head_.data(), *const next = next_.get();
  std::uint8_t* const reaches = reaches_.data();
  constexpr std::size_t kBlock = 256;
  GridSpan spans[kBlock];
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    mesh.spans(begin, size, spans);
    for (std::size_t i = 0; i < size; ++i) {
      const GridSpan s = spans[i];
      if (isLarge(s)) {
        large_.push_back(static_cast<std::uint32_t>(begin + i));
        continue;
      }
      const std::size_t c = bucketOf(s), reach = reachOf(s);
      next[begin + i] = head[c];
      head[c] = static_cast<std::uint32_t>(begin + i) | kReach.axes[reach];
      reaches[c] |= kReach.pattern[reach];
    }
    if (large_.size() > most_large) return false;
  }

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

void RootGrid::markCells() {
  const std::size_t side = std::size_t{1} << bits_;
  for (std::size_t z = 0; z < side; ++z) {
    for (std::size_t y = 0; y < side; ++y) {
      const std::uint8_t* row = &reaches_[bucket(0, y, z)];
      std::uint32_t inside = 0, reached[8] = {};
      for (std::size_t x = 0; x < side; ++x) {
        if (row[x] == 0) continue;
        inside |= (row[x] & 1u) << x;
        for (unsigned q = 0; q < 8; ++q) reached[q] |= std::uint32_t{(row[x] & kReaching[q]) != 0} << x;
      }
      is_grey_[word(bits_, y, z)] = inside;
      for (unsigned q = 0; q < 8; ++q) {
        if (reached[q] != 0) may_be_grey_[word(bits_, y + (q >> 1 & 1), z + (q >> 2))] |= reached[q] << (q & 1);
      }
    }
  }
}

void RootGrid::dropMissingCells(const Surface& surface) {
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

bool RootGrid::grey(const Surface& surface, const lattice::Cell& cell) {
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

bool RootGrid::decide(const Surface& surface, const lattice::Cell& cell) {
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
    const Eigen::Vector3d corners[3] = {surface.corner(t, 0), surface.corner(t, 1), surface.corner(t, 2)};
    return touches(corners, center, half);
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
bool RootGrid::anyCandidate(const Surface& surface, const lattice::Cell& cell, F&& f) const {
  for (unsigned q = 0; q < 8; ++q) {
    std::array<std::uint32_t, 3> from = cell.at;
    bool outside = false;
    for (unsigned k = 0; k < 3; ++k) {
      if ((q >> k & 1) == 0) continue;
      outside |= from[k] == 0;
      --from[k];
    }
    if (outside) continue;
    const std::size_t b = bucket(from[0], from[1], from[2]);
    if ((reaches_[b] & kReaching[q]) == 0) continue;
    // What starts in this cell meets it; what starts in a neighbour has to reach it on the axes between them.
    for (std::uint32_t link = head_[b]; link != kNone; link = next_[link & kTriangle]) {
      if ((link >> kAxesShift & q) == q && f(link & kTriangle)) return true;
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

void RootGrid::gather(const Surface& surface, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const {
  anyCandidate(surface, cell, [&ids](std::uint32_t t) {
    ids.push_back(t);
    return false;
  });
}

CellBounds RootGrid::look(const Surface& surface, const lattice::Cell& cell) const {
  const double half = cell.side() / 2.0;
  const auto corner = cell.corner();
  const Eigen::Vector3d center(corner[0] + half, corner[1] + half, corner[2] + half);
  thread_local OctantAccumulator seen;
  seen.clear();
  anyCandidate(surface, cell, [&](std::uint32_t t) {
    Polygon<LocalPoint> whole;
    for (int k = 0; k < 3; ++k) {
      LocalPoint p = LocalPoint::Zero();
      p.head<3>() = ((surface.corner(t, k) - center) / half).cast<float>();
      whole.add(p);
    }
    seen.add(whole, true);
    return false;
  });
  const OctantAccumulator* const all[] = {&seen};
  CellBounds b = OctantAccumulator::bounds(all, 1, Eigen::Vector3d::Zero(), 2);
  if (b.normal == CellBounds().normal) {
    // No slab is thinner than the cell: the box is one, too, and says that we have looked.
    const double lo = 127 * (b.lo[0] / 255.0 - 0.5), hi = 127 * (b.hi[0] / 255.0 - 0.5);
    b.normal[0] = 127;
    b.slab_center = static_cast<std::int8_t>(std::round((lo + hi) / 2));
    b.slab_half = static_cast<std::uint8_t>(std::min(std::ceil(hi - lo) + 2, 255.0));
  }
  return b;
}

std::size_t RootGrid::bytes() const {
  return sizeof(*this) + triangle_count_ * sizeof(next_[0]) +
         (head_.capacity() + large_.capacity() + may_be_grey_.capacity() + is_grey_.capacity()) * sizeof(head_[0]) +
         reaches_.capacity();
}

}  // namespace bocst::oracle
