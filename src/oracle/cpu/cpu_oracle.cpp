// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/cpu_oracle.h"

#include <algorithm>

#include "oracle/cpu/clip.h"
#include "oracle/cpu/kernels.h"
#include "oracle/reference.h"

namespace bocst::oracle {
namespace {

// Longer lists belong to large cells, whose slabs cull nothing and whose corners would fill memory.
constexpr std::size_t kSlabTriangles = 4096;

struct Scratch {
  LocalTriangles local;
  std::vector<Eigen::Vector3d> corners;  // of one block of triangles, in lattice units
  std::vector<std::uint8_t> masks;       // of the whole list
  std::array<OctantAccumulator, 8> octants;
};

class Expander {
 public:
  Expander(Expansion& e, Scratch& s, std::uint8_t candidates) : e_(e), s_(s), slab_(e.count <= kSlabTriangles) {
    half_ = e.cell.side() / 2.0;
    for (int k = 0; k < 3; ++k) center_[k] = e.cell.corner()[k] + half_;
    for (int o = 0; o < 8; ++o) {
      if (e.surface->lattice.exists(e.cell.octant(o))) exists_ |= 1 << o;
      s.octants[o].clear();
    }
    exists_ &= candidates;
    e.kept = nullptr;
    e.kept_lists = {};
  }

  void run() {
    s_.masks.resize(e_.count);
    s_.corners.resize(3 * std::min(e_.count, LocalTriangles::kCapacity));
    for (std::size_t begin = 0; begin < e_.count; begin += LocalTriangles::kCapacity) {
      block(begin, std::min(e_.count - begin, LocalTriangles::kCapacity));
    }
    e_.grey = proven_;
    if (e_.own_only) {
      makeOwnList();
    } else {
      makeLists();
    }
    makeBounds();
  }

 private:
  std::uint32_t id(std::size_t i) const { return e_.ids == nullptr ? static_cast<std::uint32_t>(i) : e_.ids[i]; }

  Eigen::Vector3d octantCenter(int o, double distance) const {
    return {o & 1 ? distance : -distance, o & 2 ? distance : -distance, o & 4 ? distance : -distance};
  }

  void block(std::size_t begin, std::size_t count) {
    const double inverse = 1 / half_;
    for (std::size_t i = 0; i < count; ++i) {
      const std::uint32_t t = id(begin + i);
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d p = e_.surface->corner(t, k);
        s_.corners[3 * i + k] = p;
        for (int c = 0; c < 3; ++c) s_.local.xyz[3 * k + c][i] = static_cast<float>((p[c] - center_[c]) * inverse);
      }
    }
    octantMasks(s_.local, count, 0, s_.masks.data() + begin);
    for (std::size_t i = 0; i < count; ++i) {
      std::uint8_t& mask = s_.masks[begin + i];
      mask &= exists_;
      prove(&s_.corners[3 * i], mask & ~proven_);
      if (mask != 0) bound(&s_.corners[3 * i], mask);
    }
  }

  // One certain triangle makes an octant grey; most octants are settled by the first.
  void prove(const Eigen::Vector3d* corners, int candidates) {
    for (int o = 0; candidates != 0; ++o, candidates >>= 1) {
      if ((candidates & 1) && touches(corners, center_ + octantCenter(o, half_ / 2), half_ / 2)) proven_ |= 1 << o;
    }
  }

  void bound(const Eigen::Vector3d* corners, std::uint8_t mask) {
    const double inverse = 1 / half_;
    Eigen::Vector3d local[3];
    for (int k = 0; k < 3; ++k) local[k] = (corners[k] - center_) * inverse;
    if ((mask & (mask - 1)) == 0) {
      // Most triangles are small and lie in one octant.
      const int o = __builtin_ctz(mask);
      const Eigen::Vector3d c = octantCenter(o, 0.5);
      const double reach = 0.5 + kClipMargin;
      if ((local[0] - c).lpNorm<Eigen::Infinity>() <= reach && (local[1] - c).lpNorm<Eigen::Infinity>() <= reach &&
          (local[2] - c).lpNorm<Eigen::Infinity>() <= reach) {
        s_.octants[o].add(local, 3, slab_);
        return;
      }
    }
    std::uint8_t seen = 0;
    clipToOctants(local, mask, [&](int o, const Polygon& part) {
      s_.octants[o].add(part.corners.data(), part.count, slab_);
      seen |= 1 << o;
    });
    // The test's pad is wider than the clipper's: what only the test sees is bounded by the octant itself.
    for (int missed = mask & ~seen, o = 0; missed != 0; ++o, missed >>= 1) {
      if ((missed & 1) == 0) continue;
      const Eigen::Vector3d lo = local[0].cwiseMin(local[1]).cwiseMin(local[2]);
      const Eigen::Vector3d hi = local[0].cwiseMax(local[1]).cwiseMax(local[2]);
      const Eigen::Vector3d c = octantCenter(o, 0.5), h = Eigen::Vector3d::Constant(0.5);
      s_.octants[o].addBox(lo.cwiseMax(c - h).cwiseMin(c + h), hi.cwiseMin(c + h).cwiseMax(c - h));
    }
  }

  void makeLists() {
    std::array<std::size_t, 8> sizes{};
    for (std::size_t i = 0; i < e_.count; ++i) {
      s_.masks[i] &= proven_;
      for (int o = 0; o < 8; ++o) sizes[o] += s_.masks[i] >> o & 1;
    }
    e_.list_begin[0] = 0;
    for (int o = 0; o < 8; ++o) e_.list_begin[o + 1] = e_.list_begin[o] + sizes[o];
    e_.lists.resize(e_.list_begin[8]);
    std::array<std::size_t, 8> next;
    std::copy_n(e_.list_begin.begin(), 8, next.begin());
    for (std::size_t i = 0; i < e_.count; ++i) {
      for (int bits = s_.masks[i]; bits != 0; bits &= bits - 1) e_.lists[next[__builtin_ctz(bits)]++] = id(i);
    }
  }

  void makeOwnList() {
    e_.lists.clear();
    for (std::size_t i = 0; i < e_.count; ++i) {
      if ((s_.masks[i] & proven_) != 0) e_.lists.push_back(id(i));
    }
  }

  void makeBounds() {
    OctantAccumulator* all = nullptr;
    for (int o = 0; o < 8; ++o) {
      if ((proven_ >> o & 1) == 0) continue;
      if (!e_.own_only) e_.octants.set(o, s_.octants[o].bounds(octantCenter(o, 0.5), 1));
      if (all == nullptr) {
        all = &s_.octants[o];
      } else {
        all->merge(s_.octants[o]);
      }
    }
    if (all != nullptr) e_.own = all->bounds(Eigen::Vector3d::Zero(), 2);
  }

  Expansion& e_;
  Scratch& s_;
  const bool slab_;
  double half_;
  Eigen::Vector3d center_;
  std::uint8_t exists_ = 0, proven_ = 0;
};

}  // namespace

void expand(Expansion& e, std::uint8_t candidates) {
  thread_local Scratch scratch;
  Expander(e, scratch, candidates).run();
}

void answerOnCpu(Expansion& e, std::uint8_t candidates) {
  if (e.surface->mesh == nullptr) {
    throw OracleError("the GPU that had the only copy of a mesh was lost or could not answer");
  }
  Expansion here = e;
  if (e.ids == nullptr) here.count = e.surface->mesh->triangleCount();
  expand(here, candidates);
  here.count = e.count;
  e = std::move(here);
}

void CpuOracle::submit(std::vector<Expansion>& batch) {
  for (Expansion& e : batch) expand(e);
}

std::string CpuOracle::device() { return std::string("CPU, ") + instructionSet(); }

}  // namespace bocst::oracle
