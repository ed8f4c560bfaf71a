// SPDX-License-Identifier: BSD-3-Clause
// How bounds that queries taught reach the root.
#include <algorithm>
#include <cmath>
#include <limits>

#include "tree/tree.h"

namespace bocst::tree {
namespace {

// A node's box from those of its octants; bytes of half the size, so two of the octants' make one of the node's.
void uniteBoxes(const Block& block, oracle::CellBounds& own) {
  std::array<int, 3> lo{511, 511, 511}, hi{0, 0, 0};
  for (int o = 0; o < 8; ++o) {
    if ((block.grey >> o & 1) == 0) continue;
    for (int k = 0; k < 3; ++k) {
      const int shift = (o >> k & 1) * 255;
      lo[k] = std::min(lo[k], shift + block.octants.lo[k][o]);
      hi[k] = std::max(hi[k], shift + block.octants.hi[k][o]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    own.lo[k] = std::max(own.lo[k], static_cast<std::uint8_t>(lo[k] / 2));
    own.hi[k] = std::min(own.hi[k], static_cast<std::uint8_t>((hi[k] + 1) / 2));
  }
}

// A node's slab from the bounds of its octants, if it is thinner than what is known.
void uniteSlabs(const Block& block, oracle::CellBounds& own) {
  // Everything in sides of the octants, about the node's middle; normals and offsets times 127, as stored.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int o = 0; o < 8; ++o) {
    if ((block.grey >> o & 1) == 0) continue;
    const Eigen::Vector3d m(block.octants.normal[0][o], block.octants.normal[1][o], block.octants.normal[2][o]);
    sum += m.dot(sum) < 0 ? Eigen::Vector3d(-m) : m;
  }
  const double length = sum.norm();
  if (!(length > 0)) return;
  const Eigen::Vector3d n = (sum * (127 / length)).array().round();
  double lo = std::numeric_limits<double>::infinity(), hi = -lo;
  for (int o = 0; o < 8; ++o) {
    if ((block.grey >> o & 1) == 0) continue;
    const oracle::CellBounds b = block.octants.get(o);
    const Eigen::Vector3d cell(o & 1 ? 0.5 : -0.5, o & 2 ? 0.5 : -0.5, o & 4 ? 0.5 : -0.5);
    Eigen::Vector3d center, half, m;
    for (int k = 0; k < 3; ++k) {
      center[k] = cell[k] - 0.5 + (b.lo[k] + b.hi[k]) / 510.0;
      half[k] = (b.hi[k] - b.lo[k]) / 510.0;
      m[k] = b.normal[k];
    }
    // PointSet of the octant are center + q with q in the box and m.q in a slab; any a bounds n.q by both.
    const double mm = m.squaredNorm(), a = mm > 0 ? n.dot(m) / mm : 0;
    const double middle = n.dot(center) + a * (b.slab_center - m.dot(center - cell));
    const double reach = std::abs(a) * b.slab_half / 2 + half.dot((n - a * m).cwiseAbs());
    lo = std::min(lo, middle - reach);
    hi = std::max(hi, middle + reach);
  }
  // In sides of the node, which are twice as long; the margin is far above the rounding.
  const double middle = std::round((lo + hi) / 4), margin = 1e-6;
  const double thickness = std::ceil(2 * (std::max(hi / 2 - middle, middle - lo / 2) + margin));
  const bool none = own.normal == oracle::CellBounds().normal;
  if (!(thickness < (none ? 256 : own.slab_half)) || std::abs(middle) > 127) return;
  for (int k = 0; k < 3; ++k) own.normal[k] = static_cast<std::int8_t>(n[k]);
  own.slab_center = static_cast<std::int8_t>(middle);
  own.slab_half = static_cast<std::uint8_t>(thickness);
}

}  // namespace

void Tree::refit() {
  refits_wait_.store(false, std::memory_order_relaxed);
  std::vector<Refit> refits;
  refits.swap(refits_);
  std::vector<std::uint8_t> changed(blocks_.size(), 0);
  const auto apply = [&](NodeRef node, const oracle::CellBounds& bounds) {
    if (node.isRoot()) {
      root_bounds_ = bounds;
    } else {
      blocks_[node.block()].octants.set(node.octant(), bounds);
      changed[node.block()] = 1;
    }
  };
  for (const Refit& r : refits) apply(r.node, r.bounds);
  // Children come after their parents in the pool, so one backward pass reaches the root.
  for (std::uint32_t i = blocks_.size(); i-- > 0;) {
    if (!changed[i]) continue;
    BlockRecord& record = records_[i];
    const oracle::CellBounds before = record.own;
    uniteBoxes(blocks_[i], record.own);
    uniteSlabs(blocks_[i], record.own);
    if (!(record.own == before)) apply(record.parent, record.own);
  }
}

}  // namespace bocst::tree
