// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/interior.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include "mesh/weld.h"

namespace bocst {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector3f;

// The exclusive or of the hash values of all triangles' edges is that of the edges with an odd number of triangles. The
// hash depends on all triangles, so nobody finds an open mesh where it is 0 by choosing among edges of known values.
bool isClosed(const std::vector<Mesh::Indices>& triangles, const std::vector<std::uint32_t>& welded) {
  std::uint64_t key = triangles.size();
  for (const Mesh::Indices& t : triangles) {
    key = mixed(key ^ (std::uint64_t{welded[t[0]]} << 32 | welded[t[1]]), 0x9e3779b97f4a7c15ull ^ welded[t[2]]);
  }
  const std::uint64_t key_a = mixed(key ^ 0xa0761d6478bd642full, 0xe7037ed1a0b428dbull),
                      key_b = mixed(key ^ 0x8ebc6af09c88c6e3ull, 0x589965cc75374cc3ull);
  std::uint64_t odd = 0;
  for (const Mesh::Indices& t : triangles) {
    const std::uint64_t v[3] = {welded[t[0]], welded[t[1]], welded[t[2]]};
    for (int k = 0; k < 3; ++k) {
      const std::uint64_t a = v[k], b = v[(k + 1) % 3];
      if (a != b) odd ^= mixed(std::min(a, b) ^ key_a, std::max(a, b) ^ key_b);
    }
  }
  return odd == 0;
}

/// Numbers of cells and of lines through their middles, of a vertex: those of a triangle are the least of its three.
/// Upper ends are counted from the grid's end.
struct alignas(8) Ranges {
  // Of the cells that are near, and how many lines across y have a smaller y.
  std::uint8_t first[3], lines, last_from_end[3], lines_from_end;

  friend Ranges least(const Ranges& a, const Ranges& b, const Ranges& c) {
    using Bytes __attribute__((vector_size(8))) = std::uint8_t;
    Bytes x, y, z;
    std::memcpy(&x, &a, sizeof x);
    std::memcpy(&y, &b, sizeof y);
    std::memcpy(&z, &c, sizeof z);
    x = x < y ? x : y;
    x = x < z ? x : z;
    Ranges r;
    std::memcpy(&r, &x, sizeof r);
    return r;
  }
};

/// A grid of cubes of side 1 from the origin on, `side` along each axis.
class GridRows {
 public:
  using Row = std::uint64_t;  // of cells along x, a bit each

  explicit GridRows(int bits) : bits_(bits), side_(1 << bits), near_(std::size_t{1} << 2 * bits), odd_(near_.size()) {}

  using Corners = std::array<Vector3d, 3>;

  Ranges rangesOf(const Vector3d& v) const {
    Ranges r;
    for (int k = 0; k < 3; ++k) {
      r.first[k] = static_cast<std::uint8_t>(cell(v[k] - kNear));
      r.last_from_end[k] = static_cast<std::uint8_t>(side_ - 1 - cell(v[k] + kNear));
    }
    // The least whole number that is not below y - 1/2.
    const int below = cell(v.y() - 0.5);
    r.lines = static_cast<std::uint8_t>(below + (v.y() > below + 0.5 ? 1 : 0));
    r.lines_from_end = static_cast<std::uint8_t>(side_ - r.lines);
    return r;
  }

  /// Marks the cells that the triangle comes near to, and turns over those beyond it along each row's middle line. An
  /// edge is computed alike for all its triangles, so each line crosses a closed surface an even number of times.
  /// `corners` gives the corners of the triangle. At most so many rows more are looked at one by one; else false.
  template <typename F>
  bool add(const Ranges& r, const F& corners, std::size_t& rows_left) {
    const int x0 = r.first[0], x1 = side_ - 1 - r.last_from_end[0], y0 = r.first[1],
              y1 = side_ - 1 - r.last_from_end[1], z0 = r.first[2], z1 = side_ - 1 - r.last_from_end[2];
    const int lines_end = side_ - r.lines_from_end;
    const bool is_small = (x1 - x0 <= 1) & (y1 - y0 <= 1) & (z1 - z0 <= 1);
    if (is_small) {
      const Row cells = cellsFrom(x0, x1);
      near_[row(y0, z0)] |= cells;
      near_[row(y1, z0)] |= cells;
      near_[row(y0, z1)] |= cells;
      near_[row(y1, z1)] |= cells;
      if (r.lines == lines_end) return true;
    }
    const Corners v = corners();
    if (!is_small) {
      const auto rows = static_cast<std::size_t>((y1 - y0 + 1) * (z1 - z0 + 1));
      if (rows > rows_left) return false;
      rows_left -= rows;
      markNear(v, x0, x1, y0, y1, z0, z1);
    }
    cross(v, r.lines, lines_end, z0, z1);
    return true;
  }

  Row inside(std::size_t row) const { return odd_[row] & ~near_[row] & all(); }
  Row outside(std::size_t row) const { return ~odd_[row] & ~near_[row] & all(); }
  std::size_t rows() const { return near_.size(); }

 private:
  // Beyond what positions may be off by when the grid is asked: rounding here.
  static constexpr double kNear = Interior::kAllowed + 1e-3;

  Row all() const { return ~Row{0} >> (64 - side_); }
  std::size_t row(int y, int z) const { return static_cast<std::size_t>(z << bits_ | y); }
  // A vertex that no triangle uses may be anywhere.
  int cell(double x) const { return static_cast<int>(std::min(std::max(x, 0.0), side_ - 1.0)); }
  static Row cellsFrom(int x0, int x1) { return (~Row{0} >> (63 - (x1 - x0))) << x0; }

  // Cells whose middle, as seen along x and along the triangle's normal, is no farther from the triangle than they
  // reach.
  void markNear(const Corners& v, int x0, int x1, int y0, int y1, int z0, int z1) {
    constexpr double kReach = (0.5 + kNear) * (1 + 1e-9);
    struct Line {
      Vector2d normal;
      double least;
    } edges[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector2d a = v[k].tail<2>(), b = v[(k + 1) % 3].tail<2>(), c = v[(k + 2) % 3].tail<2>();
      Vector2d n(a.y() - b.y(), b.x() - a.x());
      const double depth = n.dot(c - a), reach = kReach * n.cwiseAbs().sum();
      if (depth < 0) n = -n;
      // Seen along x, the triangle may be a line, whose sides are not known.
      edges[k] = {n, std::abs(depth) > 1e-9 * reach ? n.dot(a) - reach : -std::numeric_limits<double>::infinity()};
    }
    const Vector3d n = (v[1] - v[0]).cross(v[2] - v[0]);
    // The normal of a sliver is rounded by more than its length.
    const double reach = kReach * n.cwiseAbs().sum() + 1e-9, offset = n.dot(v[0]);
    const bool is_parallel = std::abs(n.x()) * side_ <= reach * 1e-6;
    const double per_x = is_parallel ? 0 : 1 / n.x(), reach_x = reach * std::abs(per_x) + 1e-6;
    for (int z = z0; z <= z1; ++z) {
      for (int y = y0; y <= y1; ++y) {
        const Vector2d middle(y + 0.5, z + 0.5);
        if (edges[0].normal.dot(middle) < edges[0].least || edges[1].normal.dot(middle) < edges[1].least ||
            edges[2].normal.dot(middle) < edges[2].least) {
          continue;
        }
        const double rest = offset - n.y() * middle.x() - n.z() * middle.y();
        int first = x0, last = x1;
        if (!is_parallel) {
          const double x = rest * per_x;
          first = std::max(first, cell(x - reach_x + 0.5));  // the middle of cell i is at i + 1/2
          last = std::min(last, cell(x + reach_x - 0.5));
        } else if (std::abs(rest) > 1.001 * reach) {
          continue;
        }
        if (first <= last) near_[row(y, z)] |= cellsFrom(first, last);
      }
    }
  }

  void cross(const Corners& v, int lines, int lines_end, int z0, int z1) {
    for (int y = lines; y < lines_end; ++y) {
      const double at = y + 0.5;
      Vector2d crossing[2];  // x and z
      int count = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const Vector3d &a = v[k], &b = v[(k + 1) % 3];
        if ((a.y() > at) == (b.y() > at)) continue;
        const Vector3d &below = a.y() > at ? b : a, &above = a.y() > at ? a : b;
        const double s = (at - below.y()) / (above.y() - below.y());
        crossing[count++] = {below.x() + s * (above.x() - below.x()), below.z() + s * (above.z() - below.z())};
      }
      for (int z = z0; z <= z1; ++z) {
        const double at_z = z + 0.5;
        if ((crossing[0].y() > at_z) == (crossing[1].y() > at_z)) continue;
        const double s = (at_z - crossing[0].y()) / (crossing[1].y() - crossing[0].y());
        const int x = cell(crossing[0].x() + s * (crossing[1].x() - crossing[0].x()));
        odd_[row(y, z)] ^= ~Row{1} << x;
      }
    }
  }

  const int bits_, side_;
  std::vector<Row> near_, odd_;
};

/// Of a grid for so many triangles: it takes little memory beside their tree.
int bitsOf(std::size_t triangles) {
  constexpr std::size_t kFew = 512, kMany = 8192;
  return triangles <= kFew ? 4 : triangles < kMany ? 5 : 6;
}

}  // namespace

Interior::Interior(const Mesh& mesh, const lattice::Lattice& lattice) {
  const std::vector<std::uint32_t> welded = weld(mesh.vertices());
  spreadProbes(mesh, lattice, welded);
  if (isClosed(mesh.triangles(), welded)) fillGrid(mesh, lattice);
}

// Of the component with the largest area: candidates at random, by area; then the farthest from all chosen before.
void Interior::spreadProbes(const Mesh& mesh, const lattice::Lattice& lattice,
                            const std::vector<std::uint32_t>& welded) {
  const std::vector<Mesh::Indices>& triangles = mesh.triangles();
  const std::vector<std::uint32_t> component = componentOfEachVertex(welded, triangles);
  std::vector<float> area(triangles.size());
  std::vector<double> area_of(component.size(), 0.0);
  const Vector3d size = mesh.bounds().sizes();
  const double to_one = 1 / std::max(size.maxCoeff(), std::numeric_limits<double>::min());
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Mesh::Indices& t = triangles[i];
    const Vector3d& a = mesh.vertex(t[0]);
    // In another norm, but of the same order.
    area[i] =
        static_cast<float>(((mesh.vertex(t[1]) - a) * to_one).cross((mesh.vertex(t[2]) - a) * to_one).cwiseAbs().sum());
    area_of[component[t[0]]] += static_cast<double>(area[i]);
  }
  const auto largest = static_cast<std::uint32_t>(std::max_element(area_of.begin(), area_of.end()) - area_of.begin());

  constexpr std::size_t kCandidates = 256;
  std::vector<Vector3f> candidates;
  const double step = area_of[largest] / kCandidates;
  double sum = 0, next = step / 2, u = 0.5, v = 0.5;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Mesh::Indices& t = triangles[i];
    if (component[t[0]] != largest) continue;
    sum += static_cast<double>(area[i]);
    for (; next < sum && candidates.size() < kCandidates; next += step) {
      // A point of the sequence of Roberts (R2), folded into the triangle.
      u = std::fmod(u + 0.7548776662466927, 1.0);
      v = std::fmod(v + 0.5698402909980532, 1.0);
      const bool folds = u + v > 1;
      const double p = folds ? 1 - u : u, q = folds ? 1 - v : v;
      // In lattice units: far from the origin, points of the mesh's frame are rounded more.
      const Vector3d a = lattice.toLattice(mesh.vertex(t[0])), to_b = lattice.toLattice(mesh.vertex(t[1])) - a,
                     to_c = lattice.toLattice(mesh.vertex(t[2])) - a;
      candidates.push_back((a + p * to_b + q * to_c - Vector3d::Constant(lattice::kMiddle)).cast<float>());
    }
  }
  if (candidates.empty()) return;
  std::vector<float> distance(candidates.size(), std::numeric_limits<float>::infinity());
  std::vector<Vector3f> chosen;
  for (std::size_t farthest = 0; chosen.size() < kProbes;) {
    const Vector3f probe = candidates[farthest];
    chosen.push_back(probe);
    for (std::size_t c = 0; c < candidates.size(); ++c) {
      distance[c] = std::min(distance[c], (candidates[c] - probe).squaredNorm());
      if (distance[c] > distance[farthest]) farthest = c;
    }
  }
  // Neighbours stand together: eight that are all beyond a grid need not be looked up.
  Eigen::Index axis;
  (lattice.toLattice(mesh.bounds().max()) - lattice.toLattice(mesh.bounds().min())).maxCoeff(&axis);
  std::sort(chosen.begin(), chosen.end(), [axis](const Vector3f& a, const Vector3f& b) { return a[axis] < b[axis]; });
  for (std::size_t i = 0; i < kProbes; ++i) {
    for (int k = 0; k < 3; ++k) probes[k][i] = chosen[i][k];
  }
}

void Interior::fillGrid(const Mesh& mesh, const lattice::Lattice& lattice) {
  const int bits_here = bitsOf(mesh.triangleCount());
  const int side = 1 << bits_here;
  // The bounds end a quarter of a cell before the grid does.
  constexpr double kRim = 0.25;
  const Vector3d from = lattice.toLattice(mesh.bounds().min()), to = lattice.toLattice(mesh.bounds().max());
  const Vector3d cells_per = (side - 2 * kRim) * (to - from).cwiseInverse();
  if (!(cells_per.maxCoeff() < 1)) return;  // cells below a lattice unit: the mesh is flat
  const Vector3d start = from - kRim * cells_per.cwiseInverse();
  GridRows rows(bits_here);
  // Of large triangles that are not along the axes, boxes are much larger.
  std::size_t rows_left = 16 * mesh.triangleCount() + 16384;
  const auto toCells = [&](std::uint32_t i) -> Vector3d {
    return (lattice.toLattice(mesh.vertex(i)) - start).cwiseProduct(cells_per);
  };
  std::vector<Ranges> ranges(mesh.vertexCount());
  for (std::uint32_t i = 0; i < ranges.size(); ++i) ranges[i] = rows.rangesOf(toCells(i));
  for (const Mesh::Indices& t : mesh.triangles()) {
    const auto corners = [&]() -> GridRows::Corners { return {toCells(t[0]), toCells(t[1]), toCells(t[2])}; };
    if (!rows.add(least(ranges[t[0]], ranges[t[1]], ranges[t[2]]), corners, rows_left)) return;
  }
  GridRows::Row any = 0;
  for (std::size_t i = 0; i < rows.rows(); ++i) any |= rows.inside(i);
  if (any == 0) return;
  inside.assign(rows.rows() * static_cast<std::size_t>(side) / 32, 0);
  outside = inside;
  for (std::size_t i = 0; i < rows.rows(); ++i) {
    const std::size_t first = i << bits_here;
    for (int x = 0; x < side; x += 32) {
      const std::size_t cell = first + static_cast<std::size_t>(x);
      inside[cell / 32] |= static_cast<std::uint32_t>(rows.inside(i) >> x) << cell % 32;
      outside[cell / 32] |= static_cast<std::uint32_t>(rows.outside(i) >> x) << cell % 32;
    }
  }
  bits = bits_here;
  for (int k = 0; k < 3; ++k) {
    low[k] = start[k];
    cells_per_unit[k] = cells_per[k];
  }
}

std::size_t Interior::bytes() const {
  return (inside.capacity() + outside.capacity()) * sizeof(std::uint32_t) + sizeof(*this);
}

std::size_t Interior::mostBytesOf(std::size_t triangles) {
  return sizeof(Interior) + 2 * (std::size_t{1} << 3 * bitsOf(triangles)) / 8;
}

}  // namespace bocst
