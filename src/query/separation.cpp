// SPDX-License-Identifier: BSD-3-Clause
#include "query/separation.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "query/separation.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "query/octants-inl.h"
#include "query/reach.h"

#ifndef BOCST_SEPARATION_ONCE
#define BOCST_SEPARATION_ONCE
namespace bocst::query {
namespace {

using tree::Supports;

/// Where a direction lies among the kept ones: between three of them, with weights that sum up to its largest entry.
struct alignas(64) Places {
  std::int32_t at[3][8];
  float weight[3][8];
};

// Looks narrow down: most that are apart are found so by the first, all but few by the fourth. Hulls of what touches
// overlap by more than kHopeless of the smaller side in every direction nearly always, so most hits cost one look or
// none; a small body on the outside of a large one may cost all of them.
constexpr int kLooks = 6;
// What a miss pays for later ones, on each side: so much as to look at some thousands of triangles. To grow a node by
// what the root grid knows is as much as a thousand.
constexpr std::size_t kEffort = 1 << 13, kGrowthEffort = 1 << 10;
constexpr float kFirstRadius = 0.45f, kHopeless = 0.15f, kHopelessLater = 0.6f;
constexpr float kShallow = 0.3f;

inline float interpolated(const Supports& s, const Places& p, std::size_t lane) {
  return p.weight[0][lane] * s.value(p.at[0][lane]) + p.weight[1][lane] * s.value(p.at[1][lane]) +
         p.weight[2][lane] * s.value(p.at[2][lane]);
}

}  // namespace
}  // namespace bocst::query
#endif

HWY_BEFORE_NAMESPACE();
namespace bocst::query::HWY_NAMESPACE {

HWY_INLINE void locate(const V (&u)[3], std::size_t lane, Places& p) {
  const D d;
  const hn::RebindToSigned<D> di;
  const V zero = hn::Zero(d), one = hn::Set(d, 1), half = hn::Set(d, Supports::kCells / 2.0f);
  const V ax = hn::Abs(u[0]), ay = hn::Abs(u[1]), az = hn::Abs(u[2]);
  const M is_x = hn::And(hn::Ge(ax, ay), hn::Ge(ax, az)), is_y = hn::AndNot(is_x, hn::Ge(ay, az));
  const auto choose = [&](V x, V y, V z) { return hn::IfThenElse(is_x, x, hn::IfThenElse(is_y, y, z)); };
  const V major = choose(u[0], u[1], u[2]), size = hn::Abs(major), per = hn::Div(half, size);
  // What is not a number comes to some cell, too.
  const V last = hn::Set(d, Supports::kCells - 1);
  const auto cell = [&](V x, V& rest) {
    const V at = hn::MulAdd(x, per, half);
    const V i = hn::Max(hn::Min(hn::Floor(at), last), zero);
    rest = hn::Max(hn::Min(hn::Sub(at, i), one), zero);
    return i;
  };
  V rest_i, rest_j;
  const V i = cell(choose(u[1], u[2], u[0]), rest_i), j = cell(choose(u[2], u[0], u[1]), rest_j);
  const V high = hn::Max(rest_i, rest_j), low = hn::Min(rest_i, rest_j);
  const V face = hn::Add(choose(zero, hn::Set(d, 2), hn::Set(d, 4)), hn::IfThenElseZero(hn::Lt(major, zero), one));
  const V row = hn::Set(d, Supports::kRow);
  const auto at = hn::ConvertTo(di, hn::MulAdd(hn::MulAdd(face, row, i), row, j));
  const auto aside = hn::ConvertTo(di, hn::IfThenElse(hn::Ge(rest_i, rest_j), row, one));
  hn::Store(at, di, p.at[0] + lane);
  hn::Store(hn::Add(at, aside), di, p.at[1] + lane);
  hn::Store(hn::Add(at, hn::Set(di, Supports::kRow + 1)), di, p.at[2] + lane);
  hn::Store(hn::Mul(size, hn::Sub(one, high)), d, p.weight[0] + lane);
  hn::Store(hn::Mul(size, hn::Sub(high, low)), d, p.weight[1] + lane);
  hn::Store(hn::Mul(size, low), d, p.weight[2] + lane);
}

/// Where the pair's lattices lie to each other, in float; t is the way between the middles of the roots.
struct Between {
  float rotation[3][3];  // [j][k]: column j
  float t[3];
  float scale, slack, defect;
};

// f of EightSeparations, and the largest of it; places are those of the directions in both sides' frames.
HWY_INLINE float values(const Supports& a, const Supports& b, const Between& g, const float (*u)[8], Places& in_a,
                        Places& in_b, float* value) {
  const D d;
  alignas(64) float along[8];
  for (std::size_t lane = 0; lane < 8; lane += hn::Lanes(d)) {
    V v[3], w[3], sum = hn::Zero(d);
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      v[k] = hn::Load(d, u[k] + lane);
      sum = hn::MulAdd(hn::Set(d, g.t[k]), v[k], sum);
    }
    BOCST_UNROLL
    for (int j = 0; j < 3; ++j) {
      w[j] = hn::Mul(hn::Set(d, -g.rotation[j][0]), v[0]);
      w[j] = hn::NegMulAdd(hn::Set(d, g.rotation[j][1]), v[1], w[j]);
      w[j] = hn::NegMulAdd(hn::Set(d, g.rotation[j][2]), v[2], w[j]);
    }
    locate(v, lane, in_a);
    locate(w, lane, in_b);
    hn::Store(sum, d, along + lane);
  }
  float most = -1e30f;
  for (std::size_t lane = 0; lane < 8; ++lane) {
    value[lane] = along[lane] - interpolated(a, in_a, lane) - g.scale * interpolated(b, in_b, lane);
    most = std::max(most, value[lane]);
  }
  return most;
}

// The directions about a unit one, `radius` away in the plane across it, and, as the first of seven, itself.
HWY_INLINE void ringAbout(const float (&n)[3], float radius, const float (*circle)[8], float (*u)[8]) {
  const float sign = std::copysign(1.0f, n[2]), a = -1 / (sign + n[2]), b = n[0] * n[1] * a;
  const float across[2][3] = {{1 + sign * n[0] * n[0] * a, sign * b, -sign * n[0]}, {b, sign + n[1] * n[1] * a, -n[1]}};
  const D d;
  for (std::size_t lane = 0; lane < 8; lane += hn::Lanes(d)) {
    const V x = hn::Mul(hn::Set(d, radius), hn::Load(d, circle[0] + lane));
    const V y = hn::Mul(hn::Set(d, radius), hn::Load(d, circle[1] + lane));
    BOCST_UNROLL
    for (int k = 0; k < 3; ++k) {
      hn::Store(hn::MulAdd(hn::Set(d, across[0][k]), x, hn::MulAdd(hn::Set(d, across[1][k]), y, hn::Set(d, n[k]))), d,
                u[k] + lane);
    }
  }
}

HWY_ALIGN constexpr float kSevenAndMiddle[2][8] = {
    {0, 1, 0.6234898f, -0.2225209f, -0.9009689f, -0.9009689f, -0.2225209f, 0.6234898f},
    {0, 0, 0.7818315f, 0.9749279f, 0.4338837f, -0.4338837f, -0.9749279f, -0.7818315f}};
HWY_ALIGN constexpr float kEight[2][8] = {{1, 0.7071068f, 0, -0.7071068f, -1, -0.7071068f, 0, 0.7071068f},
                                          {0, 0.7071068f, 1, 0.7071068f, 0, -0.7071068f, -1, -0.7071068f}};

HWY_INLINE Between between(const Placement& b_in_a) {
  constexpr double q = lattice::kMiddle;
  const double* r = b_in_a.rotation.data();
  Between g;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) g.rotation[j][k] = b_in_a.axes[j][k];
    g.t[k] = static_cast<float>(b_in_a.translation[k] - q + q * b_in_a.scale * (r[k] + r[k + 3] + r[k + 6]));
  }
  g.scale = static_cast<float>(b_in_a.scale);
  g.slack = static_cast<float>(b_in_a.slack);
  g.defect = static_cast<float>(b_in_a.defect);
  return g;
}

// Which of eight values is the largest; 8 if they are not numbers.
HWY_INLINE std::size_t largest(const float (&values)[8]) {
  const D d;
  V most = hn::LoadU(d, values);
  for (std::size_t i = hn::Lanes(d); i < 8; i += hn::Lanes(d)) most = hn::Max(most, hn::LoadU(d, values + i));
  const V all = hn::MaxOfLanes(d, most);
  unsigned bits = 1u << 8;
  for (std::size_t i = 0; i < 8; i += hn::Lanes(d)) bits |= maskBits(hn::Eq(hn::LoadU(d, values + i), all)) << i;
  return static_cast<std::size_t>(__builtin_ctz(bits));
}

// The direction from the middle of a's bounds to that of b's, and how far that is.
HWY_INLINE float wayBetweenMiddles(const Supports& a, const Supports& b, const Between& g, float (&n)[3]) {
  const Eigen::Vector3f &from = a.center(), &to = b.center();
  float squared = 0;
  for (int k = 0; k < 3; ++k) {
    const float turned = g.rotation[0][k] * to[0] + g.rotation[1][k] * to[1] + g.rotation[2][k] * to[2];
    n[k] = g.t[k] + g.scale * turned - from[k];
    squared += n[k] * n[k];
  }
  const float length = std::sqrt(squared), per_length = 1 / length;
  for (float& x : n) x *= per_length;
  return length;
}

bool AreSeparate(const Supports& a, const Supports& b, const Placement& b_in_a, NearDirections& near) {
  near.lanes = 0;
  near.shallow = false;
  const Between g = between(b_in_a);
  const float size = static_cast<float>(lattice::kMiddle) * (1 + g.scale);
  const float smaller = 2 * lattice::kMiddle * std::min(1.0f, g.scale);
  const float distance = std::abs(g.t[0]) + std::abs(g.t[1]) + std::abs(g.t[2]);
  const float pad = 1.25f * (64 * 0x1p-24f * (distance + 2 * size) + g.slack);
  float n[3];
  const float length = wayBetweenMiddles(a, b, g, n);
  // Not true of what is not a number.
  if (!(length > 1e-6f * size && length < 0x1p50f && g.defect < 1e-3f)) return false;
  // No direction can do better than this; most hits are so deep.
  if (length - a.innerRadius() - g.scale * b.innerRadius() < -kHopeless * smaller) return false;

  alignas(64) float u[3][8];
  float value[8];
  Places in_a, in_b;
  float best = -1e30f, hopeless = -kHopeless * smaller, radius = kFirstRadius;
  for (int look = 0; look < kLooks; ++look) {
    ringAbout(n, radius, look == 0 ? kSevenAndMiddle : kEight, u);
    if (values(a, b, g, u, in_a, in_b, value) > pad) return true;
    const std::size_t lane = largest(value);
    if (lane == 8) return false;
    if (value[lane] > best) {
      best = value[lane];
      if (best < hopeless) break;
      const bool same = look == 0 && lane == 0;
      const float shrink = same ? 1 : 1 / std::sqrt(1 + radius * radius);
      for (int k = 0; k < 3; ++k) n[k] = u[k][lane] * shrink;
      radius *= same ? 0.5f : 0.7f;
    } else {
      radius *= 0.4f;
    }
    hopeless *= kHopelessLater;
  }
  near.lanes = 8;
  near.shallow = best > -kShallow * smaller;
  for (int k = 0; k < 3; ++k) {
    std::copy_n(in_a.at[k], 8, near.of_a[k]);
    std::copy_n(in_b.at[k], 8, near.of_b[k]);
  }
  return false;
}

void Evaluate(const Supports& a, const Supports& b, const Placement& b_in_a, EightSeparations& eight) {
  alignas(64) float u[3][8];
  for (int k = 0; k < 3; ++k) std::copy_n(eight.u[k], 8, u[k]);
  Places in_a, in_b;
  values(a, b, between(b_in_a), u, in_a, in_b, eight.value);
  for (int k = 0; k < 3; ++k) {
    std::copy_n(in_a.at[k], 8, eight.of_a[k]);
    std::copy_n(in_b.at[k], 8, eight.of_b[k]);
  }
}

}  // namespace bocst::query::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace bocst::query {

HWY_EXPORT(AreSeparate);
HWY_EXPORT(Evaluate);

bool areSeparate(const Supports& a, const Supports& b, const Placement& b_in_a, NearDirections& near) {
  return HWY_DYNAMIC_DISPATCH(AreSeparate)(a, b, b_in_a, near);
}

void evaluate(const Supports& a, const Supports& b, const Placement& b_in_a, EightSeparations& eight) {
  HWY_DYNAMIC_DISPATCH(Evaluate)(a, b, b_in_a, eight);
}

namespace {

// A part of the surface and how far it may reach.
struct Part {
  double reach;
  tree::NodeRef node;
  bool known = false;    // the tree can say no more
  bool reached = false;  // by a vertex
  bool operator<(const Part& other) const { return reach < other.reach; }
};

// Asks one tree how far its surface reaches, after a miss.
class Sharpening {
 public:
  explicit Sharpening(const TreeSide& side) : side_(side), room_(room()) {}

  /// Of a kept direction; false when that takes more effort than is left.
  bool ask(int number) {
    tree::Supports& supports = side_.tree().supports();
    direction_ = Supports::direction(number);
    has_all_effort_ = left_ == kEffort;
    room_.parts.clear();
    addNode(side_.root());
    while (!room_.parts.empty()) {
      std::pop_heap(room_.parts.begin(), room_.parts.end());
      const Part part = room_.parts.back();
      room_.parts.pop_back();
      if (part.known) {
        supports.lower(number, part.reach, part.reached);
        return true;
      }
      if (growsFreely(part.node) && !grow(part.node)) return false;
      if (side_.state(part.node) == State::kInner) {
        side_.children(part.node, [this](tree::NodeRef node) { addNode(node); });
      } else if (!addTriangles(part)) {
        return false;
      }
    }
    // A sampled oracle has lost all of the surface.
    supports.lower(number, supports.value(number), false);
    return true;
  }

 private:
  // Kept by the thread.
  struct Room {
    std::vector<Part> parts;  // a heap
    std::vector<std::uint32_t> triangles;
    std::vector<tree::Tree::Growth> growth;
  };
  static Room& room() {
    thread_local Room room;
    return room;
  }

  void add(const Part& part) {
    room_.parts.push_back(part);
    std::push_heap(room_.parts.begin(), room_.parts.end());
  }

  void addNode(tree::NodeRef node) {
    const NodeReach reach(side_.volume(node), Placement());
    double lo, hi;
    reach.along(direction_, lo, hi);
    add({hi + direction_.dot(reach.center - middle_), node});
  }

  // The part as its triangles know it, or, if it cannot be otherwise, its bounds.
  bool addTriangles(const Part& part) {
    const bool are_known = side_.tree().trianglesOf(part.node, left_, room_.triangles) && !room_.triangles.empty();
    left_ -= std::min(left_, room_.triangles.size());
    if (!are_known) {
      // Perhaps they only are too many for what is left now.
      if (has_all_effort_) add({part.reach, part.node, true, false});
      return has_all_effort_;
    }
    double reach = -std::numeric_limits<double>::infinity();
    for (const std::uint32_t t : room_.triangles) {
      for (int k = 0; k < 3; ++k) reach = std::max(reach, direction_.dot(side_.corner(t, k) - middle_));
    }
    add({reach, part.node, true, true});
    return true;
  }

  bool growsFreely(tree::NodeRef node) const {
    return side_.state(node) == State::kGrows && side_.growsFreely(node) && side_.tree().hasRoom();
  }

  // Unless another thread grows the tree just now.
  bool grow(tree::NodeRef node) {
    if (left_ < kGrowthEffort) return false;
    left_ -= kGrowthEffort;
    has_all_effort_ = false;
    room_.growth.clear();
    side_.grow(node, room_.growth);
    tree::Tree::grow(room_.growth, false);
    return side_.state(node) == State::kInner;
  }

  const TreeSide& side_;
  Room& room_;
  const Eigen::Vector3d middle_ = Eigen::Vector3d::Constant(lattice::kMiddle);
  Eigen::Vector3d direction_;
  std::size_t left_ = kEffort;
  bool has_all_effort_ = true;  // for the direction that is asked about
};

void sharpen(const TreeSide& side, const std::int32_t (&near)[3][8]) {
  tree::Supports& supports = side.tree().supports();
  supports.reopen(side.tree().growth());
  Sharpening sharpening(side);
  for (int lane = 0; lane < 8; ++lane) {
    for (int k = 0; k < 3; ++k) {
      if (supports.isOpen(near[k][lane]) && !sharpening.ask(near[k][lane])) return;
    }
  }
}

}  // namespace

void sharpenSupports(const TreeSide& a, const TreeSide& b, const NearDirections& near) {
  if (near.lanes == 0) return;
  sharpen(a, near.of_a);
  sharpen(b, near.of_b);
}

}  // namespace bocst::query
#endif
