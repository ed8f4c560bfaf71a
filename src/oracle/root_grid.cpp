// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/root_grid.h"

#include <algorithm>
#include <array>

#include "oracle/reference.h"

namespace bocst::oracle {
namespace {

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr std::size_t kSmallest = 4096;   // triangles: below, plain expansions are as fast
constexpr std::size_t kLargeShare = 256;  // at most one triangle in so many may span more than two cells
constexpr int kQuantBits = 15;            // vertices as int16, in steps of two lattice units
constexpr int kQuantMax = (1 << kQuantBits) - 1;

// Four lanes that the compiler keeps in one register on every target; the last is unused.
using Quantised = std::int16_t __attribute__((vector_size(8)));

// One step of margin on both sides covers the rounding of toLattice and closed cells that only touch.
struct Span {
  std::array<int, 3> first, reach;  // the cell of the minimum corner, how many cells further the maximum corner is
};

inline Quantised least(Quantised a, Quantised b) { return a < b ? a : b; }
inline Quantised greatest(Quantised a, Quantised b) { return a > b ? a : b; }

inline Span spanOf(Quantised a, Quantised b, Quantised c, int shift) {
  const Quantised one = {1, 1, 1, 1}, zero = {0, 0, 0, 0}, top = {kQuantMax, kQuantMax, kQuantMax, kQuantMax};
  const Quantised lo = greatest(least(least(a, b), c), one) - one;
  const Quantised hi = least(greatest(greatest(a, b), c), top - one) + one;
  const Quantised first = greatest(lo, zero) >> shift, reach = (hi >> shift) - first;
  return {{first[0], first[1], first[2]}, {reach[0], reach[1], reach[2]}};
}

inline std::int16_t quantise(double p) {
  return static_cast<std::int16_t>(std::clamp(p * 0.5, 0.0, double{kQuantMax}));
}

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

// Calls f for each triangle that may meet the cell until one returns true.
template <typename F>
bool RootGrid::anyCandidate(const lattice::Cell& cell, F&& f) const {
  const std::uint32_t width = 1u << (level() - cell.level);
  std::array<std::uint32_t, 3> first;
  for (int k = 0; k < 3; ++k) first[k] = cell.at[k] * width - (cell.at[k] > 0 ? 1 : 0);
  for (std::uint32_t z = first[2]; z < (cell.at[2] + 1) * width; ++z) {
    for (std::uint32_t y = first[1]; y < (cell.at[1] + 1) * width; ++y) {
      for (std::uint32_t x = first[0]; x < (cell.at[0] + 1) * width; ++x) {
        for (std::uint32_t t = head_[index(x, y, z)]; t != kNone; t = next_[t]) {
          if (f(t)) return true;
        }
      }
    }
  }
  return std::any_of(large_.begin(), large_.end(), f);
}

bool RootGrid::build(const Surface& surface) {
  const Mesh& mesh = *surface.mesh;
  const std::size_t count = mesh.triangleCount();
  const int shift = kQuantBits - bits_;
  const std::uint32_t side = 1u << bits_;

  std::vector<Quantised> vertices(mesh.vertexCount());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d p = surface.lattice.toLattice(mesh.vertex(i));
    vertices[i] = Quantised{quantise(p.x()), quantise(p.y()), quantise(p.z()), 0};
  }

  head_.assign(std::size_t{1} << 3 * bits_, kNone);
  next_.resize(count);
  // Bit p of reaches[c]: a triangle of bucket c extends to the next cell on the axes of p; bit 0: one lies inside.
  std::vector<std::uint8_t> reaches(head_.size(), 0);
  const std::size_t most_large = count / kLargeShare;
  for (std::size_t t = 0; t < count; ++t) {
    const Mesh::Indices& i = mesh.indices(t);
    const Span s = spanOf(vertices[i[0]], vertices[i[1]], vertices[i[2]], shift);
    if ((s.reach[0] | s.reach[1] | s.reach[2]) > 1) {
      next_[t] = kNone;
      large_.push_back(static_cast<std::uint32_t>(t));
      if (large_.size() > most_large) return false;
      continue;
    }
    const std::size_t c = index(s.first[0], s.first[1], s.first[2]);
    next_[t] = head_[c];
    head_[c] = static_cast<std::uint32_t>(t);
    reaches[c] |= 1 << (s.reach[0] | s.reach[1] << 1 | s.reach[2] << 2);
  }

  // 1: some triangle's box meets the cell; 2: certainly grey.
  grey_.assign(bits_, {});
  std::vector<std::uint8_t>& finest = grey_.back();
  finest.assign(head_.size(), 0);
  for (std::uint32_t z = 0; z < side; ++z) {
    for (std::uint32_t y = 0; y < side; ++y) {
      for (std::uint32_t x = 0; x < side; ++x) {
        const std::uint8_t r = reaches[index(x, y, z)];
        if (r == 0) continue;
        if (r & 1) finest[index(x, y, z)] |= 2;
        for (int p = 1; p < 8; ++p) {
          if ((r >> p & 1) == 0) continue;
          for (int q = p;; q = (q - 1) & p) {  // all subsets of p
            finest[index(x + (q & 1), y + (q >> 1 & 1), z + (q >> 2 & 1))] |= 1;
            if (q == 0) break;
          }
        }
      }
    }
  }
  for (const std::uint32_t t : large_) {
    const Mesh::Indices& i = mesh.indices(t);
    const Span s = spanOf(vertices[i[0]], vertices[i[1]], vertices[i[2]], shift);
    for (int z = 0; z <= s.reach[2]; ++z) {
      for (int y = 0; y <= s.reach[1]; ++y) {
        for (int x = 0; x <= s.reach[0]; ++x) finest[index(s.first[0] + x, s.first[1] + y, s.first[2] + z)] |= 1;
      }
    }
  }
  for (std::uint32_t z = 0; z < side; ++z) {
    for (std::uint32_t y = 0; y < side; ++y) {
      for (std::uint32_t x = 0; x < side; ++x) {
        std::uint8_t& state = finest[index(x, y, z)];
        const lattice::Cell cell{level(), {x, y, z}};
        if (state != 0 && !surface.lattice.exists(cell)) state = 0;
        if (state == 1) {
          const double half = cell.side() / 2.0;
          const Eigen::Vector3d center = Eigen::Vector3d(x + 0.5, y + 0.5, z + 0.5) * cell.side();
          const bool is_grey = anyCandidate(cell, [&](std::uint32_t t) {
            const Mesh::Indices& i = mesh.indices(t);
            const Span s = spanOf(vertices[i[0]], vertices[i[1]], vertices[i[2]], shift);
            for (int k = 0; k < 3; ++k) {
              const int at = static_cast<int>(cell.at[k]);
              if (at < s.first[k] || at > s.first[k] + s.reach[k]) return false;
            }
            const Eigen::Vector3d corners[3] = {surface.corner(t, 0), surface.corner(t, 1), surface.corner(t, 2)};
            return touches(corners, center, half);
          });
          state = is_grey ? 1 : 0;
        }
        state = state != 0;
      }
    }
  }
  for (int b = bits_ - 1; b >= 1; --b) {
    const std::vector<std::uint8_t>& fine = grey_[b];
    std::vector<std::uint8_t>& coarse = grey_[b - 1];
    coarse.assign(std::size_t{1} << 3 * b, 0);
    for (std::size_t i = 0; i < fine.size(); ++i) {
      if (fine[i] == 0) continue;
      const std::size_t mask = (std::size_t{1} << (b + 1)) - 1;
      const std::size_t x = i & mask, y = i >> (b + 1) & mask, z = i >> 2 * (b + 1);
      coarse[((z / 2) << b | y / 2) << b | x / 2] = 1;
    }
  }
  return true;
}

bool RootGrid::grey(const lattice::Cell& cell) const {
  const int b = cell.level - 1;
  return grey_[b - 1][((std::size_t{cell.at[2]} << b) | cell.at[1]) << b | cell.at[0]] != 0;
}

Eigen::AlignedBox3d RootGrid::bounds(const lattice::Cell& cell) const {
  const int down = level() - cell.level;
  const std::uint32_t width = 1u << down, unit = cell.side() >> down;
  Eigen::AlignedBox3d box;
  for (std::uint32_t z = cell.at[2] * width; z < (cell.at[2] + 1) * width; ++z) {
    for (std::uint32_t y = cell.at[1] * width; y < (cell.at[1] + 1) * width; ++y) {
      for (std::uint32_t x = cell.at[0] * width; x < (cell.at[0] + 1) * width; ++x) {
        if (grey_.back()[index(x, y, z)] == 0) continue;
        box.extend(Eigen::Vector3d(x, y, z) * unit);
        box.extend(Eigen::Vector3d(x + 1, y + 1, z + 1) * unit);
      }
    }
  }
  return box;
}

void RootGrid::gather(const Surface& surface, const lattice::Cell& cell, std::vector<std::uint32_t>& ids) const {
  const double margin = 2;  // lattice units: one step of the quantisation
  const auto corner = cell.corner();
  double lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    lo[k] = corner[k] - margin;
    hi[k] = corner[k] + cell.side() + margin;
  }
  anyCandidate(cell, [&](std::uint32_t t) {
    const Eigen::Vector3d a = surface.corner(t, 0), b = surface.corner(t, 1), c = surface.corner(t, 2);
    bool meets = true;
    for (int k = 0; k < 3; ++k) {
      meets &= std::min(std::min(a[k], b[k]), c[k]) <= hi[k] && std::max(std::max(a[k], b[k]), c[k]) >= lo[k];
    }
    if (meets) ids.push_back(t);
    return false;
  });
}

std::size_t RootGrid::bytes() const {
  std::size_t bytes = sizeof(*this) + (head_.capacity() + next_.capacity() + large_.capacity()) * sizeof(head_[0]);
  for (const auto& g : grey_) bytes += sizeof(g) + g.capacity();
  return bytes;
}

}  // namespace bocst::oracle
