// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/cpu/cpu_oracle.h"

#include <algorithm>
#include <numeric>

#include "oracle/cpu/clip.h"
#include "oracle/cpu/kernels.h"
#include "oracle/reference.h"
#include "thread/of_thread.h"

namespace bocst::oracle {
namespace {

// Longer lists belong to large cells, whose slabs cull nothing and whose corners would fill memory.
constexpr std::size_t kSlabTriangles = 4096;

struct Scratch {
  LocalTriangles local;
  std::array<LocalPoint, 3 * LocalTriangles::kCapacity> corners;  // of one block of triangles
  std::vector<std::uint8_t> masks;                                // of the whole list
  std::array<OctantAccumulator, 8> octants;
};

class Expander {
 public:
  Expander(ExpansionRequest& e, Scratch& s, std::uint8_t candidates) : e_(e), s_(s), slab_(e.count <= kSlabTriangles) {
    half_ = e.cell.side() / 2.0;
    for (int k = 0; k < 3; ++k) center_[k] = e.cell.corner()[k] + half_;
    for (int o = 0; o < 8; ++o) {
      if (e.surface->lattice.exists(e.cell.octant(o))) exists_ |= 1 << o;
      s.octants[o].clear();
    }
    exists_ &= candidates;
    e.batch = nullptr;
    e.on_device = 0;
  }

  void run() {
    s_.masks.resize(e_.count);
    for (std::size_t begin = 0; begin < e_.count; begin += LocalTriangles::kCapacity) {
      block(begin, std::min(e_.count - begin, LocalTriangles::kCapacity));
    }
    e_.grey = proven_;
    makeLists();
    makeBounds();
  }

 private:
  std::uint32_t id(std::size_t i) const { return e_.ids == nullptr ? static_cast<std::uint32_t>(i) : e_.ids[i]; }

  Eigen::Vector3d octantCenter(int o, double distance) const {
    return {o & 1 ? distance : -distance, o & 2 ? distance : -distance, o & 4 ? distance : -distance};
  }

  static LocalPoint localOctantCenter(int o) {
    alignas(16) static constexpr float kCenters[8][4] = {
        {-0.5f, -0.5f, -0.5f, 0}, {0.5f, -0.5f, -0.5f, 0}, {-0.5f, 0.5f, -0.5f, 0}, {0.5f, 0.5f, -0.5f, 0},
        {-0.5f, -0.5f, 0.5f, 0},  {0.5f, -0.5f, 0.5f, 0},  {-0.5f, 0.5f, 0.5f, 0},  {0.5f, 0.5f, 0.5f, 0}};
    return LocalPoint::Map(kCenters[o]);
  }

  static bounds::CellFrame localOctant(int o) {
    return {{o & 1 ? 0.0 : -1.0, o & 2 ? 0.0 : -1.0, o & 4 ? 0.0 : -1.0}, 1};
  }

  static bool allUpTo(float most, const LocalPoint& p) { return p[0] <= most && p[1] <= most && p[2] <= most; }

  void block(std::size_t begin, std::size_t count) {
    const Mesh& mesh = *e_.surface->mesh;
    const Eigen::Vector3d& origin = e_.surface->lattice.origin();
    const double inverse = 1 / half_, scale = e_.surface->lattice.inverseUnit() * inverse;
    const double shift[3] = {center_[0] * inverse, center_[1] * inverse, center_[2] * inverse};
    for (std::size_t i = 0; i < count; ++i) {
      const Mesh::Indices& indices = mesh.indices(id(begin + i));
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d& v = mesh.vertex(indices[k]);
        LocalPoint& p = s_.corners[3 * i + k];
        p[3] = 0;
        for (int c = 0; c < 3; ++c) {
          p[c] = s_.local.xyz[3 * k + static_cast<std::size_t>(c)][i] =
              static_cast<float>((v[c] - origin[c]) * scale - shift[c]);
        }
      }
    }
    octantMasks(s_.local, count, 0, s_.masks.data() + begin);
    for (std::size_t i = 0; i < count; ++i) {
      std::uint8_t& mask = s_.masks[begin + i];
      mask &= exists_;
      if ((mask & ~proven_) != 0) prove(id(begin + i), mask & ~proven_);
      if (mask != 0) bound(id(begin + i), &s_.corners[3 * i], mask);
    }
  }

  // One certain triangle makes an octant grey; most octants are settled by the first.
  void prove(std::uint32_t t, int candidates) {
    const auto corners = e_.surface->corners(t);
    for (int o = 0; candidates != 0; ++o, candidates >>= 1) {
      if ((candidates & 1) && triangleMeetsCube(corners.data(), center_ + octantCenter(o, half_ / 2), half_ / 2))
        proven_ |= 1 << o;
    }
  }

  void bound(std::uint32_t t, const LocalPoint* corners, std::uint8_t mask) {
    const LocalPoint lo = corners[0].cwiseMin(corners[1]).cwiseMin(corners[2]);
    const LocalPoint hi = corners[0].cwiseMax(corners[1]).cwiseMax(corners[2]);
    if ((mask & (mask - 1)) == 0) {
      // Most triangles are small and lie in one octant.
      const int o = __builtin_ctz(mask);
      const LocalPoint c = localOctantCenter(o);
      if (allUpTo(0.5f + kClipMargin, (hi - c).cwiseMax(c - lo))) {
        s_.octants[o].add(corners, 3, lo, hi, slab_);
        return;
      }
    }
    // kClipMargin is wider than the rounding of both, so what the test proves to meet an octant has a part there.
    const auto take = [this](int o, const auto& part) { s_.octants[o].add(part, slab_); };
    if (allUpTo(kFloatReach, hi.cwiseMax(-lo))) {
      clipToOctants(corners, mask, take);
    } else {
      Eigen::Vector3d exact[3];
      for (int k = 0; k < 3; ++k) exact[k] = (e_.surface->corner(t, k) - center_) / half_;
      clipToOctants(exact, mask, take);
    }
  }

  // 1 in byte o for bit o.
  static std::uint64_t bytesOfBits(std::uint8_t bits) {
    const std::uint64_t own_bit_in_each = bits * 0x0101010101010101u & 0x8040201008040201u;
    return (own_bit_in_each + 0x7f7f7f7f7f7f7f7fu) >> 7 & 0x0101010101010101u;
  }

  void makeLists() {
    e_.sizes = {};
    constexpr std::size_t kMostInByte = 255;
    for (std::size_t begin = 0; begin < e_.count; begin += kMostInByte) {
      std::uint64_t sums = 0;  // a byte for each octant
      for (std::size_t i = begin; i < std::min(begin + kMostInByte, e_.count); ++i) {
        s_.masks[i] &= proven_;
        sums += bytesOfBits(s_.masks[i]);
      }
      for (int o = 0; o < 8; ++o) e_.sizes[o] += sums >> 8 * o & 0xff;
    }
    std::array<std::size_t, 8> next;
    std::exclusive_scan(e_.sizes.begin(), e_.sizes.end(), next.begin(), std::size_t{0});
    e_.lists.resize(next[7] + e_.sizes[7]);
    e_.first_on_host = 0;
    for (std::size_t i = 0; i < e_.count; ++i) {
      for (int bits = s_.masks[i]; bits != 0; bits &= bits - 1) e_.lists[next[__builtin_ctz(bits)]++] = id(i);
    }
  }

  void makeBounds() {
    std::array<const OctantAccumulator*, 8> grey;
    std::size_t count = 0;
    for (int o = 0; o < 8; ++o) {
      if ((proven_ >> o & 1) == 0) continue;
      grey[count] = &s_.octants[o];
      e_.octants.set(o, OctantAccumulator::bounds(&grey[count], 1, localOctant(o)));
      ++count;
    }
    if (count != 0) e_.own = OctantAccumulator::bounds(grey.data(), count, {{-1, -1, -1}, 2});
  }

  ExpansionRequest& e_;
  Scratch& s_;
  const bool slab_;
  double half_;
  Eigen::Vector3d center_;
  std::uint8_t exists_ = 0, proven_ = 0;
};

}  // namespace

void expand(ExpansionRequest& e, std::uint8_t candidates) {
  Expander(e, thread::ofThread<Scratch>(), candidates).run();
}

void answerOnCpu(ExpansionRequest& e, std::uint8_t candidates) {
  if (e.surface->mesh == nullptr) {
    throw OracleError("the GPU that had the only copy of a mesh was lost or could not answer");
  }
  ExpansionRequest here = e;
  if (e.ids == nullptr) here.count = e.surface->mesh->triangleCount();
  expand(here, candidates);
  here.count = e.count;
  e = std::move(here);
}

void CpuOracle::submit(std::vector<ExpansionRequest>& batch) {
  for (ExpansionRequest& e : batch) expand(e);
}

std::string CpuOracle::device() { return std::string("CPU, ") + instructionSet(); }

}  // namespace bocst::oracle
