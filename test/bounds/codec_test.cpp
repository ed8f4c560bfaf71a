// SPDX-License-Identifier: BSD-3-Clause
// The codec of node bounds by itself: all bytes, every level, against the definition in node_bounds.h.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "bounds/cell_frame.h"
#include "bounds/loose_frame.h"
#include "bounds/merge.h"

namespace bocst::bounds {
namespace {

constexpr int kLevels = 17;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kFloatUnit = 0x1p-24, kTiny = 0x1p-40;  // kTiny: above the rounding of a few sums of steps in double

std::vector<CellFrame> cellsOfEveryLevel() {
  std::vector<CellFrame> cells;
  for (int level = 1; level <= kLevels; ++level) {
    const double side = 1 << (kLevels - level), last = 65536 - side;
    cells.push_back({{0, last, std::floor(last / 2 / side) * side}, side});
  }
  return cells;
}

// Every length of the longest side with every combination of thin axes.
std::vector<LooseFrame> looseFrames() {
  std::vector<LooseFrame> frames;
  for (int exponent = LooseFrame::kLeastExponent; exponent <= LooseFrame::kMostExponent; ++exponent) {
    for (int thin = 0; thin < 64; ++thin) {
      LooseFrame f;
      f.exponent = static_cast<std::uint8_t>(exponent);
      for (int k = 0; k < 3; ++k) {
        f.thin[k] = static_cast<std::uint8_t>(thin >> 2 * k & 3);
        f.origin[k] = static_cast<std::uint16_t>(k == 0 ? 0 : k == 1 ? 65534 : 2 * (977 * exponent + 31 * thin));
      }
      frames.push_back(f);
    }
  }
  return frames;
}

NodeBounds randomBounds(std::mt19937_64& g) {
  NodeBounds b;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto x = static_cast<std::uint8_t>(g()), y = static_cast<std::uint8_t>(g());
    b.lo[k] = std::min(x, y);
    b.hi[k] = g() % 8 == 0 ? b.lo[k] : std::max(x, y);
  }
  std::normal_distribution<double> normal;
  std::int8_t n[3];
  if (g() % 4 == 0 || !encodeNormal(normal(g), normal(g), normal(g), n)) return b;
  std::copy_n(n, 3, b.normal.begin());
  b.slab_center = static_cast<std::int8_t>(static_cast<int>(g() % 255) - 127);
  b.slab_half = static_cast<std::uint8_t>(g());
  return b;
}

TEST(Codec, StepsAreRoundedOutwardsAndCutOff) {
  for (int byte = 0; byte <= kBoxSteps; ++byte) {
    for (const double off : {-0.75, -0.5, -1e-9, 0.0, 1e-9, 0.5, 0.75}) {
      for (const double steps : {byte + off, std::nextafter(byte + off, -1e9), std::nextafter(byte + off, 1e9)}) {
        const double within = std::clamp(steps, 0.0, 255.0);
        EXPECT_EQ(roundedDown(steps), std::floor(within)) << steps;
        EXPECT_EQ(roundedUp(steps), std::ceil(within)) << steps;
      }
    }
  }
  for (const double far : {300.0, 1e9, 1e300, kInfinity}) {
    EXPECT_EQ(roundedDown(far), 255);
    EXPECT_EQ(roundedUp(far), 255);
    EXPECT_EQ(roundedDown(-far), 0);
    EXPECT_EQ(roundedUp(-far), 0);
  }
  EXPECT_EQ(roundedUp(5e-324), 1);
}

void expectNormal(double x, double y, double z) {
  std::int8_t n[3];
  ASSERT_TRUE(encodeNormal(x, y, z, n)) << x << " " << y << " " << z;
  const double size = std::max({std::abs(x), std::abs(y), std::abs(z)});
  const double d[3] = {x / size, y / size, z / size};
  const double length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
  int norm1 = 0;
  for (int k = 0; k < 3; ++k) {
    ASSERT_LE(std::abs(n[k] - kNormalLength * d[k] / length), 0.5 + 1e-9) << x << " " << y << " " << z;
    norm1 += std::abs(n[k]);
  }
  ASSERT_LE(norm1, kMostNormalNorm1);
}

TEST(Codec, NormalsAreUnitVectorsInBytes) {
  for (int x = -9; x <= 9; ++x) {
    for (int y = -9; y <= 9; ++y) {
      for (int z = -9; z <= 9; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        // As floats that are hardly numbers, and that nearly are none.
        for (const float scale : {1e-45f, 1e-22f, 1e-3f, 1.0f, 3e37f}) {
          expectNormal(double{scale * static_cast<float>(x)}, double{scale * static_cast<float>(y)},
                       double{scale * static_cast<float>(z)});
        }
      }
    }
  }
  std::int8_t n[3] = {1, 2, 3};
  EXPECT_FALSE(encodeNormal(0, 0, 0, n));
  EXPECT_FALSE(encodeNormal(kInfinity, 1, 0, n));
  EXPECT_FALSE(encodeNormal(0, std::nan(""), 1, n));
  EXPECT_EQ(n[0] + n[1] + n[2], 6);
}

TEST(Codec, BoxesInCellsOfEveryLevel) {
  for (const CellFrame& cell : cellsOfEveryLevel()) {
    for (int lo = 0; lo <= 255; ++lo) {
      for (int hi = lo; hi <= 255; ++hi) {
        NodeBounds b;
        const std::size_t k = static_cast<std::size_t>(lo + hi) % 3;
        b.lo[k] = static_cast<std::uint8_t>(lo);
        b.hi[k] = static_cast<std::uint8_t>(hi);
        const Volume v = cell.decode(b);
        // Times 510, exact: integers below 2^26.
        const double middle = 510 * cell.corner[k] + (lo + hi) * cell.side, half = (hi - lo) * cell.side;
        ASSERT_NEAR(510 * v.center[k], middle, 2e-15 * 510 * 65536);
        ASSERT_NEAR(510 * double{v.half[k]}, half, 1.01 * kFloatUnit * half);
        // Back to the same bytes, from a hair inside.
        NodeBounds again;
        const double hair = lo == hi ? 0 : 1e-9 * cell.side;
        cell.encodeBox(k, (middle - half) / 510 + hair, (middle + half) / 510 - hair, again);
        ASSERT_TRUE(lo == hi || again == b) << lo << " " << hi;
        ASSERT_GE(again.lo[k], lo - 1);
        ASSERT_LE(again.hi[k], hi + 1);
      }
    }
  }
  std::mt19937_64 g(1);
  std::uniform_real_distribution<double> u(0, 1);
  for (const CellFrame& cell : cellsOfEveryLevel()) {
    for (int i = 0; i < 2000; ++i) {
      double x = u(g), y = u(g);
      if (x > y) std::swap(x, y);
      const std::size_t k = g() % 3;
      const double least = cell.corner[k] + x * cell.side, most = cell.corner[k] + y * cell.side;
      NodeBounds b;
      cell.encodeBox(k, least, most, b);
      // `least` itself is rounded: by 2^-37 units at most, which are less than 2^-29 steps.
      ASSERT_LE(cell.corner[k] + b.lo[k] * cell.side / 255, least + 1e-11);
      ASSERT_GE(cell.corner[k] + b.hi[k] * cell.side / 255, most - 1e-11);
      ASSERT_GT(b.lo[k] + 1, (least - cell.corner[k]) * 255 / cell.side - kTiny);
      ASSERT_LT(b.hi[k] - 1, (most - cell.corner[k]) * 255 / cell.side + kTiny);
    }
  }
}

TEST(Codec, BoxesInLooseFramesOfEverySize) {
  std::mt19937_64 g(2);
  std::uniform_real_distribution<double> u(0, 1);
  for (const LooseFrame& f : looseFrames()) {
    for (int byte = 0; byte <= 255; ++byte) {
      NodeBounds b;
      double lo[3], hi[3];
      for (std::size_t k = 0; k < 3; ++k) {
        const int other = static_cast<int>(g() % 256);
        b.lo[k] = static_cast<std::uint8_t>(std::min(byte, other));
        b.hi[k] = static_cast<std::uint8_t>(std::max(byte, other));
      }
      const Volume v = f.decode(b);
      for (std::size_t k = 0; k < 3; ++k) {
        const double side = f.side(k), middle = f.origin[k] + (b.lo[k] + b.hi[k]) * side / 510;
        ASSERT_NEAR(v.center[k], middle, 1e-10);
        ASSERT_NEAR(f.middle(b, k), middle, 1e-10);
        ASSERT_NEAR(f.lower(b, k), f.origin[k] + b.lo[k] * side / 255, 1e-10);
        ASSERT_NEAR(f.upper(b, k), f.origin[k] + b.hi[k] * side / 255, 1e-10);
        const double half = (b.hi[k] - b.lo[k]) * side / 510;
        ASSERT_NEAR(double{v.half[k]}, half, 1.01 * kFloatUnit * half);
        // Any box within these bytes, with the margin inside.
        const double x = b.lo[k] + u(g) * (b.hi[k] - b.lo[k]), y = x + u(g) * (b.hi[k] - x);
        lo[k] = f.origin[k] + x * side / 255 + LooseFrame::kMargin;
        hi[k] = std::max(lo[k], f.origin[k] + y * side / 255 - LooseFrame::kMargin);
      }
      NodeBounds again;
      f.encodeBox(lo, hi, again);
      for (std::size_t k = 0; k < 3; ++k) {
        // Nothing is lost, with most of the margin; nor is more than a step and the margin given away.
        const double step = f.side(k) / 255;
        ASSERT_LE(f.lower(again, k), std::max<double>(f.origin[k], lo[k] - 0.9 * LooseFrame::kMargin));
        ASSERT_GE(f.upper(again, k), std::min<double>(f.origin[k] + f.side(k), hi[k] + 0.9 * LooseFrame::kMargin));
        ASSERT_GE(f.lower(again, k), lo[k] - 1.1 * LooseFrame::kMargin - step);
        ASSERT_LE(f.upper(again, k), hi[k] + 1.1 * LooseFrame::kMargin + step);
      }
    }
  }
}

TEST(Codec, LooseFramesHoldTheirBoxAndTheirBits) {
  for (const LooseFrame& f : looseFrames()) {
    const LooseFrame again = LooseFrame::unpack(f.pack());
    EXPECT_LT(f.pack(), std::uint64_t{1} << 55);
    EXPECT_EQ(again.exponent, f.exponent);
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_EQ(again.thin[k], f.thin[k]);
      EXPECT_EQ(again.origin[k], f.origin[k]);
      EXPECT_EQ(f.side(k), std::ldexp(1, f.exponent - LooseFrame::kShifts[f.thin[k]]));
    }
  }
  std::mt19937_64 g(3);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < 100000; ++i) {
    double lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
      const double size = std::exp2(-20 * u(g));
      lo[k] = 65536 * u(g) * (1 - size) - (i % 5 == 0 ? 1e-7 : 0);
      hi[k] = std::min(lo[k] + 65536 * size * u(g), 65536.0);
    }
    const LooseFrame f = LooseFrame::of(lo, hi);
    for (std::size_t k = 0; k < 3; ++k) {
      ASSERT_LE(f.origin[k], std::max(lo[k] - 0.9 * LooseFrame::kMargin, 0.0));
      ASSERT_GE(f.origin[k] + f.side(k), hi[k] + 0.9 * LooseFrame::kMargin);
      ASSERT_EQ(f.origin[k] % 2, 0);
    }
  }
}

// All slabs that bytes can say come back from what they say; nothing else is said.
template <typename Frame>
void checkSlabs(const Frame& frame, double unit, bool exact, std::mt19937_64& g) {
  std::uniform_real_distribution<double> u(0, 1);
  const std::int8_t n[3] = {3, -100, 78};
  const double per_length = kNormalLength * unit;  // of n . (p - m), a slab unit
  for (int center = -127; center <= 127; ++center) {
    for (int half = 0; half <= 255; ++half) {
      NodeBounds b;
      frame.encodeSlab(n, (center - half / 2.0) * per_length, (center + half / 2.0) * per_length, b);
      if (exact) {
        ASSERT_EQ(b.slab_center, center);
        ASSERT_EQ(b.slab_half, half);
      }
      ASSERT_TRUE(b.hasSlab() || (!exact && half == 255));
      if (!b.hasSlab()) continue;
      ASSERT_TRUE(std::equal(n, n + 3, b.normal.begin()));
      const double least = center - half / 2.0, most = center + half / 2.0;
      ASSERT_LE(b.slab_center - b.slab_half / 2.0, least + kTiny);
      ASSERT_GE(b.slab_center + b.slab_half / 2.0, most - kTiny);
      ASSERT_LE(b.slab_half, half + 1);
    }
  }
  int said = 0;
  for (int i = 0; i < 20000; ++i) {
    const double at = 300 * (u(g) - 0.5), thickness = 300 * std::exp2(-8 * u(g)) * u(g);
    const double least = at - thickness / 2, most = at + thickness / 2;
    NodeBounds b;
    frame.encodeSlab(n, least * per_length, most * per_length, b);
    if (!b.hasSlab()) {
      ASSERT_TRUE(b == NodeBounds());
      ASSERT_TRUE(std::abs(at) > 127.4 || thickness > 254) << at << " " << thickness;
      continue;
    }
    ++said;
    ASSERT_LE(b.slab_center - b.slab_half / 2.0, least + kTiny);
    ASSERT_GE(b.slab_center + b.slab_half / 2.0, most - kTiny);
    // The middle is rounded by half a unit, the half by half.
    ASSERT_LE(b.slab_half, thickness + 2);
  }
  EXPECT_GT(said, 5000);
  NodeBounds none;
  for (const auto& [least, most] : {std::pair{-kInfinity, kInfinity},
                                    {kInfinity, -kInfinity},
                                    {std::nan(""), 0.0},
                                    {0.0, kInfinity},
                                    {200 * per_length, 201 * per_length}}) {
    frame.encodeSlab(n, least, most, none);
    EXPECT_TRUE(none == NodeBounds());
  }
}

TEST(Codec, SlabsInFramesOfEverySize) {
  std::mt19937_64 g(4);
  for (const CellFrame& cell : cellsOfEveryLevel()) {
    checkSlabs(cell, cell.side / kCellSlabSteps, true, g);
    if (HasFatalFailure()) return;
  }
  for (const LooseFrame& f : looseFrames()) {
    if (f.thin[0] + f.thin[1] + f.thin[2] != 0) continue;  // a slab follows the longest side
    checkSlabs(f, f.longest() / kLooseSlabSteps, false, g);
    if (HasFatalFailure()) return;
  }
}

TEST(Codec, DecodedSlabsSayWhatTheBytesSay) {
  std::mt19937_64 g(5);
  const auto check = [](const NodeBounds& b, const Volume& v, const double(&m)[3], double unit) {
    // The middle of the slab along the normal, from the middle of the box.
    double offset = b.slab_center * unit, size = std::abs(offset);
    for (std::size_t k = 0; k < 3; ++k) {
      const double n = b.normal[k] / 127.0, part = n * (v.center[k] - m[k]);
      ASSERT_NEAR(double{v.normal[k]}, n, 1.01 * kFloatUnit * std::abs(n));
      offset -= part;
      size += std::abs(part);
    }
    ASSERT_NEAR(double{v.slab_offset}, offset, 1.01 * kFloatUnit * std::abs(offset) + 1e-10 + 1e-14 * size);
    const double half = b.slab_half * unit / 2;
    ASSERT_NEAR(double{v.slab_half}, half, 1.01 * kFloatUnit * half);
  };
  for (const CellFrame& cell : cellsOfEveryLevel()) {
    const double middle[3] = {cell.middle(0), cell.middle(1), cell.middle(2)};
    for (int i = 0; i < 65536; ++i) {
      NodeBounds b = randomBounds(g);
      b.slab_center = static_cast<std::int8_t>(i & 255);
      b.slab_half = static_cast<std::uint8_t>(i >> 8);
      check(b, cell.decode(b), middle, cell.side / 127);
      if (HasFatalFailure()) return;
    }
  }
  for (const LooseFrame& f : looseFrames()) {
    for (int i = 0; i < 256; ++i) {
      NodeBounds b = randomBounds(g);
      b.slab_center = static_cast<std::int8_t>(i);
      b.slab_half = static_cast<std::uint8_t>(255 - i);
      const double middle[3] = {f.middle(b, 0), f.middle(b, 1), f.middle(b, 2)};
      check(b, f.decode(b), middle, f.longest() / 256);
      if (HasFatalFailure()) return;
    }
  }
}

TEST(Codec, EightNodesAreKeptApart) {
  std::mt19937_64 g(6);
  OctantBounds octants;
  NodeBounds expected[8];
  for (int i = 0; i < 10000; ++i) {
    const std::size_t o = g() % 8;
    octants.set(o, expected[o] = randomBounds(g));
    if (i < 100) continue;
    for (std::size_t k = 0; k < 8; ++k) ASSERT_TRUE(octants.get(k) == expected[k]);
    if (i % 100 != 0) continue;
    octants.fill(expected[0] = randomBounds(g));
    for (NodeBounds& b : expected) b = expected[0];
    for (std::size_t k = 0; k < 8; ++k) ASSERT_TRUE(octants.get(k) == expected[0]);
  }
}

// The box about what octants bound, by encoding it: in steps of the cell, exact.
NodeBounds unionOf(const OctantBounds& octants, unsigned mask) {
  NodeBounds b;
  for (std::size_t k = 0; k < 3; ++k) {
    double least = kInfinity, most = -kInfinity;
    for (std::size_t o = 0; o < 8; ++o) {
      if ((mask >> o & 1) == 0) continue;
      const double corner = (o >> k & 1) != 0 ? 127.5 : 0;
      least = std::min(least, corner + octants.lo[k][o] / 2.0);
      most = std::max(most, corner + octants.hi[k][o] / 2.0);
    }
    b.setBox(k, least, most);
  }
  return b;
}

TEST(Codec, MergedBoxesAreWhatEncodingTheirUnionGives) {
  // One octant: all bytes in both halves of all axes.
  for (std::size_t o = 0; o < 8; ++o) {
    for (int lo = 0; lo <= 255; ++lo) {
      for (int hi = lo; hi <= 255; ++hi) {
        NodeBounds b;
        b.lo.fill(static_cast<std::uint8_t>(lo));
        b.hi.fill(static_cast<std::uint8_t>(hi));
        OctantBounds octants;
        octants.set(o, b);
        NodeBounds cell;
        tightenBox(octants, 1u << o, cell);
        ASSERT_TRUE(cell == unionOf(octants, 1u << o)) << o << " " << lo << " " << hi;
      }
    }
  }
  // Some octants, with anything in the others, and a cell of which something is known.
  std::mt19937_64 g(7);
  for (int i = 0; i < 100000; ++i) {
    OctantBounds octants;
    for (std::size_t o = 0; o < 8; ++o) octants.set(o, randomBounds(g));
    const unsigned mask = 1 + static_cast<unsigned>(g() % 255);
    NodeBounds cell, known = randomBounds(g);
    tightenBox(octants, mask, cell);
    const NodeBounds expected = unionOf(octants, mask);
    ASSERT_TRUE(cell.lo == expected.lo && cell.hi == expected.hi);
    NodeBounds tighter = known;
    tightenBox(octants, mask, tighter);
    for (std::size_t k = 0; k < 3; ++k) {
      ASSERT_EQ(tighter.lo[k], std::max(known.lo[k], expected.lo[k]));
      ASSERT_EQ(tighter.hi[k], std::min(known.hi[k], expected.hi[k]));
    }
  }
}

// The corners of box AND slab of an octant, in sides of the cell from its middle.
std::vector<std::array<double, 3>> cornersOf(const NodeBounds& b, std::size_t o) {
  std::vector<std::array<double, 3>> corners;
  double lo[3], hi[3];  // in sides of the octant, from its middle
  for (std::size_t k = 0; k < 3; ++k) lo[k] = b.lo[k] / 255.0 - 0.5, hi[k] = b.hi[k] / 255.0 - 0.5;
  const double below = b.slab_center - b.slab_half / 2.0, above = b.slab_center + b.slab_half / 2.0;
  const auto along = [&](const std::array<double, 3>& p) {
    return b.normal[0] * p[0] + b.normal[1] * p[1] + b.normal[2] * p[2];
  };
  const auto add = [&](std::array<double, 3> p) {
    for (std::size_t k = 0; k < 3; ++k) p[k] = (p[k] + ((o >> k & 1) != 0 ? 0.5 : -0.5)) / 2;
    corners.push_back(p);
  };
  for (std::size_t i = 0; i < 8; ++i) {
    const std::array<double, 3> p = {i & 1 ? hi[0] : lo[0], i & 2 ? hi[1] : lo[1], i & 4 ? hi[2] : lo[2]};
    const double at = along(p);
    if (!b.hasSlab() || (at >= below && at <= above)) add(p);
    if (!b.hasSlab()) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      if ((i >> k & 1) != 0 || b.normal[k] == 0) continue;
      for (const double plane : {below, above}) {
        std::array<double, 3> q = p;
        q[k] += (plane - at) / b.normal[k];
        if (q[k] >= lo[k] && q[k] <= hi[k]) add(q);
      }
    }
  }
  return corners;
}

TEST(Codec, MergedSlabsHoldAllThatTheOctantsHold) {
  std::mt19937_64 g(8);
  std::normal_distribution<double> normal;
  int merged = 0, kept = 0, corners = 0;
  for (int i = 0; i < 30000; ++i) {
    // Octants of a surface that is nearly flat, and of any.
    double n[3] = {normal(g), normal(g), normal(g)};
    OctantBounds octants;
    for (std::size_t o = 0; o < 8; ++o) {
      NodeBounds b = randomBounds(g);
      std::int8_t bytes[3];
      const double bend = i % 3 == 0 ? 3 : 0.1, turn = g() % 2 ? 1 : -1;
      if (encodeNormal(turn * n[0] + bend * normal(g), turn * n[1] + bend * normal(g), turn * n[2] + bend * normal(g),
                       bytes) &&
          i % 7 != 0) {
        std::copy_n(bytes, 3, b.normal.begin());
        b.slab_center = static_cast<std::int8_t>(static_cast<int>(g() % 41) - 20);
        b.slab_half = static_cast<std::uint8_t>(g() % 30);
      }
      octants.set(o, b);
    }
    const unsigned mask = 1 + static_cast<unsigned>(g() % 255);
    NodeBounds known;
    if (i % 5 == 0) known = randomBounds(g);
    NodeBounds cell = known;
    tightenSlab(octants, mask, cell);
    ASSERT_TRUE(cell.lo == known.lo && cell.hi == known.hi);
    if (cell == known) {
      ++kept;
      continue;
    }
    ++merged;
    ASSERT_TRUE(!known.hasSlab() || cell.slab_half < known.slab_half);
    for (std::size_t o = 0; o < 8; ++o) {
      if ((mask >> o & 1) == 0) continue;
      for (const auto& p : cornersOf(octants.get(o), o)) {
        const double along = cell.normal[0] * p[0] + cell.normal[1] * p[1] + cell.normal[2] * p[2];
        ASSERT_LE(std::abs(along - cell.slab_center), cell.slab_half / 2.0 - 0.9e-6) << i;
        ++corners;
      }
    }
  }
  EXPECT_GT(merged, 10000);
  EXPECT_GT(kept, 1000);
  EXPECT_GT(corners, 100000);
}

// A plane through all octants stays a plane: no thicker than the octants' slabs and what three bytes round.
TEST(Codec, MergedSlabsOfAPlaneAreThin) {
  for (const int half : {0, 1, 7, 40}) {
    OctantBounds octants;
    for (std::size_t o = 0; o < 8; ++o) {
      NodeBounds b;
      // z = the middle of the cell, 10 steps of the octants' slabs up.
      const std::int8_t up[3] = {0, 0, 127};
      std::copy_n(up, 3, b.normal.begin());
      b.slab_center = static_cast<std::int8_t>(((o & 4) != 0 ? -63 : 64) + 10);
      b.slab_half = static_cast<std::uint8_t>(half);
      octants.set(o, b);
    }
    NodeBounds cell;
    tightenSlab(octants, 0xff, cell);
    EXPECT_EQ(cell.normal[2], 127);
    EXPECT_NEAR(cell.slab_center, 5, 1);
    EXPECT_LE(cell.slab_half, half / 2 + 3);
  }
}

}  // namespace
}  // namespace bocst::bounds
