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
constexpr int kQuantBits = 15;            // vertices as int16, in steps of two lattice units
constexpr double kMargin = 2;             // lattice units: one step

// Four lanes that the compiler keeps in a register on every target; the last means nothing.
using Quantised = std::int16_t __attribute__((vector_size(8)));

inline Quantised least(Quantised a, Quantised b) { return a < b ? a : b; }
inline Quantised greatest(Quantised a, Quantised b) { return a > b ? a : b; }

// The cell of a triangle's minimum corner, and how many cells further its maximum corner is; 16 bits an axis. One step
// of margin on both sides covers the rounding of toLattice and closed cells that only touch.
struct Span {
  std::uint64_t first, reach;

  Span(Quantised a, Quantised b, Quantised c, int shift) {
    const Quantised one = {1, 1, 1, 1}, top = one * ((1 << kQuantBits) - 2);
    const Quantised lo = (greatest(least(least(a, b), c), one) - one) >> shift;
    const Quantised hi = (least(greatest(greatest(a, b), c), top) + one) >> shift;
    const Quantised way = hi - lo;
    std::memcpy(&first, &lo, sizeof(first));
    std::memcpy(&reach, &way, sizeof(reach));
  }

  std::size_t bucket(int bits) const {
    return (first & 0xffff) | (first >> 16 & 0xffff) << bits | (first >> 32 & 0xffff) << 2 * bits;
  }
  bool isLarge() const { return (reach & 0xfffefffefffeu) != 0; }
  unsigned axes() const { return (reach | reach >> 15 | reach >> 30) & 7; }
  std::uint32_t firstOn(int axis) const { return first >> 16 * axis & 0xffff; }
  std::uint32_t lastOn(int axis) const { return firstOn(axis) + (reach >> 16 * axis & 0xffff); }
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
  const Mesh& mesh = *surface.mesh;
  const std::size_t count = mesh.triangleCount(), most_large = count / kLargeShare;
  const int shift = kQuantBits - bits_;
  // Three each, and one more that the last vertex is read with.
  std::vector<std::int16_t> vertices(3 * mesh.vertexCount() + 1);
  quantise(mesh.vertices().data()->data(), mesh.vertexCount(), surface.lattice.origin().data(),
           surface.lattice.inverseUnit() / kMargin, (1 << kQuantBits) - 1, vertices.data());
  const auto spanOf = [shift, coordinates = vertices.data(), triangles = mesh.triangles().data()](std::size_t t) {
    const auto corner = [&](std::size_t k) {
      Quantised v;
      std::memcpy(&v, coordinates + 3 * std::size_t{triangles[t][k]}, sizeof(v));
      return v;
    };
    return Span(corner(0), corner(1), corner(2), shift);
  };

  head_.assign(std::size_t{1} << 3 * bits_, kNone);
  reaches_.assign(head_.size(), 0);
  next_.resize(count);
  const int bits = bits_;
  std::uint32_t *const head = head_.data(), *const next = next_.data();
  std::uint8_t* const reaches = reaches_.data();
  for (std::size_t t = 0; t < count; ++t) {
    const Span s = spanOf(t);
    if (s.isLarge()) {
      next[t] = kNone;
      large_.push_back(static_cast<std::uint32_t>(t));
      if (large_.size() > most_large) return false;
      continue;
    }
    const std::size_t c = s.bucket(bits);
    next[t] = head[c];
    head[c] = static_cast<std::uint32_t>(t);
    reaches[c] |= 1 << s.axes();
  }

  states_.assign(static_cast<std::size_t>(bits_), {});
  states_.back().assign(head_.size(), kWhite);
  markCells(surface);
  for (const std::uint32_t t : large_) {
    const Span s = spanOf(t);
    for (std::uint32_t z = s.firstOn(2); z <= s.lastOn(2); ++z) {
      for (std::uint32_t y = s.firstOn(1); y <= s.lastOn(1); ++y) {
        for (std::uint32_t x = s.firstOn(0); x <= s.lastOn(0); ++x) {
          const lattice::Cell cell{level(), {x, y, z}};
          if (surface.lattice.exists(cell)) state(cell) = std::max(state(cell), kUnknown);
        }
      }
    }
  }
  for (int b = bits_ - 1; b >= 1; --b) {
    const std::vector<State>& fine = states_[static_cast<std::size_t>(b)];
    std::vector<State>& coarse = states_[static_cast<std::size_t>(b) - 1];
    coarse.assign(std::size_t{1} << 3 * b, kWhite);
    const std::size_t mask = (std::size_t{1} << (b + 1)) - 1;
    for (std::size_t i = 0; i < fine.size(); ++i) {
      if (fine[i] == kWhite) continue;
      State& s = coarse[index(b, (i & mask) / 2, (i >> (b + 1) & mask) / 2, (i >> 2 * (b + 1)) / 2)];
      s = std::max(s, fine[i]);
    }
  }
  return true;
}

void RootGrid::markCells(const Surface& surface) {
  const std::uint32_t side = 1u << bits_;
  for (std::uint32_t z = 0; z < side; ++z) {
    for (std::uint32_t y = 0; y < side; ++y) {
      for (std::uint32_t x = 0; x < side; ++x) {
        const unsigned r = reaches_[index(bits_, x, y, z)];
        if (r == 0) continue;
        for (unsigned q = 0; q < 8; ++q) {
          if ((r & kReaching[q]) == 0) continue;
          const lattice::Cell cell{level(), {x + (q & 1), y + (q >> 1 & 1), z + (q >> 2 & 1)}};
          if (!surface.lattice.exists(cell)) continue;
          const State known = q == 0 && (r & 1) != 0 ? kGrey : kUnknown;
          state(cell) = std::max(state(cell), known);
        }
      }
    }
  }
}

bool RootGrid::grey(const Surface& surface, const lattice::Cell& cell) {
  State& s = state(cell);
  if (s == kUnknown) {
    bool is_grey = false;
    if (cell.level < level()) {
      for (int o = 0; o < 8 && !is_grey; ++o) is_grey = grey(surface, cell.octant(o));
    } else {
      const double half = cell.side() / 2.0;
      const auto corner = cell.corner();
      const Eigen::Vector3d center(corner[0] + half, corner[1] + half, corner[2] + half);
      is_grey = anyCandidate(surface, cell, [&](std::uint32_t t) {
        const Eigen::Vector3d corners[3] = {surface.corner(t, 0), surface.corner(t, 1), surface.corner(t, 2)};
        return touches(corners, center, half);
      });
    }
    s = is_grey ? kGrey : kWhite;
  }
  return s == kGrey;
}

Eigen::AlignedBox3d RootGrid::bounds(const lattice::Cell& cell) const {
  const int down = level() - cell.level;
  const std::uint32_t width = 1u << down, unit = cell.side() >> down;
  Eigen::AlignedBox3d box;
  for (std::uint32_t z = cell.at[2] * width; z < (cell.at[2] + 1) * width; ++z) {
    for (std::uint32_t y = cell.at[1] * width; y < (cell.at[1] + 1) * width; ++y) {
      for (std::uint32_t x = cell.at[0] * width; x < (cell.at[0] + 1) * width; ++x) {
        if (states_.back()[index(bits_, x, y, z)] == kWhite) continue;
        box.extend(Eigen::Vector3d(x, y, z) * unit);
        box.extend(Eigen::Vector3d(x + 1, y + 1, z + 1) * unit);
      }
    }
  }
  return box;
}

// Calls f for each triangle that may meet a cell of the finest level, until one returns true.
template <typename F>
bool RootGrid::anyCandidate(const Surface& surface, const lattice::Cell& cell, F&& f) const {
  const Mesh& mesh = *surface.mesh;
  const Eigen::Vector3d& origin = surface.lattice.origin();
  const double inverse_unit = surface.lattice.inverseUnit();
  const auto at = [&](std::uint32_t vertex, int k) { return (mesh.vertex(vertex)[k] - origin[k]) * inverse_unit; };
  double lo[3], hi[3];
  for (std::size_t k = 0; k < 3; ++k) {
    lo[k] = cell.corner()[k] - kMargin;
    hi[k] = lo[k] + cell.side() + 2 * kMargin;
  }
  for (unsigned q = 0; q < 8; ++q) {
    std::array<std::uint32_t, 3> from = cell.at;
    bool outside = false;
    for (unsigned k = 0; k < 3; ++k) {
      if ((q >> k & 1) == 0) continue;
      outside |= from[k] == 0;
      --from[k];
    }
    if (outside) continue;
    const std::size_t bucket = index(bits_, from[0], from[1], from[2]);
    if ((reaches_[bucket] & kReaching[q]) == 0) continue;
    // What starts in this cell meets it; what starts in a neighbour has to reach it on the axes between them.
    for (std::uint32_t t = head_[bucket]; t != kNone; t = next_[t]) {
      const Mesh::Indices& i = mesh.indices(t);
      bool reaches = true;
      for (int k = 0; k < 3 && reaches; ++k) {
        if (q >> k & 1) reaches = std::max(std::max(at(i[0], k), at(i[1], k)), at(i[2], k)) >= lo[k];
      }
      if (reaches && f(t)) return true;
    }
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
    Eigen::Vector3d local[3];
    for (int k = 0; k < 3; ++k) local[k] = (surface.corner(t, k) - center) / half;
    seen.add(local, 3, true);
    return false;
  });
  CellBounds b = seen.bounds(Eigen::Vector3d::Zero(), 2);
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
  std::size_t bytes = sizeof(*this) + (head_.capacity() + next_.capacity() + large_.capacity()) * sizeof(head_[0]) +
                      reaches_.capacity();
  for (const auto& s : states_) bytes += sizeof(s) + s.capacity();
  return bytes;
}

}  // namespace bocst::oracle
