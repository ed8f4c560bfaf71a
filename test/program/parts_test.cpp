// SPDX-License-Identifier: BSD-3-Clause
// The parts of the program that can be tested without running it.
#include <bocst/fcl.h>
#include <bocst/model.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "cli/printable.h"
#include "cli/report.h"
#include "cli/suggest.h"
#include "commands/validation.h"
#include "mesh/closest_point.h"
#include "mesh/health.h"
#include "mesh/protrusion.h"
#include "mesh/sphere_fit.h"
#include "mesh/spheres.h"
#include "meshes.h"
#include "pairs/beyond_limits.h"
#include "pairs/poses.h"
#include "pairs/query_pair.h"
#include "picture/display_mesh.h"
#include "picture/page.h"

namespace bocst {
namespace {

using program::Health;
using program::healthOf;

Health healthOfRaw(const test::Raw& raw) { return healthOf(*raw.mesh()); }

test::Raw cube() { return test::box({0, 0, 0}, {1, 2, 3}); }

TEST(Health, OfASoundMesh) {
  const Health health = healthOfRaw(cube());
  EXPECT_TRUE(health.watertight());
  EXPECT_TRUE(health.oriented());
  EXPECT_EQ(health.components, 1u);
  EXPECT_EQ(health.degenerate_triangles + health.duplicate_triangles + health.repeated_vertices, 0u);
  EXPECT_NEAR(health.area, 22, 1e-12);
  EXPECT_NEAR(std::abs(health.volume), 6, 1e-12);
}

TEST(Health, SeesTheShapeRatherThanTheIndices) {
  const Health health = healthOfRaw(test::unwelded(cube()));
  EXPECT_TRUE(health.watertight());
  EXPECT_EQ(health.components, 1u);
  EXPECT_EQ(health.repeated_vertices, 36u - 8u);
  EXPECT_NEAR(std::abs(health.volume), 6, 1e-12);
  test::Raw zeros = test::box({0, 0, 0}, {1, 1, 1});
  for (std::size_t i = 0; i < zeros.vertices.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      if (i % 2 == 0 && zeros.vertices[i][k] == 0) zeros.vertices[i][k] = -0.0;
    }
  }
  EXPECT_EQ(healthOfRaw(test::unwelded(zeros)).repeated_vertices, 36u - 8u) << "-0 is 0";
}

TEST(Health, TurnedInsideOutTheVolumeChangesItsSign) {
  EXPECT_DOUBLE_EQ(healthOfRaw(test::turnedOver(cube())).volume, -healthOfRaw(cube()).volume);
}

TEST(Health, CountsEachFault) {
  test::Raw raw = cube();
  raw.triangles.pop_back();
  EXPECT_EQ(healthOfRaw(raw).open_edges, 3u);
  EXPECT_FALSE(healthOfRaw(raw).watertight());
  EXPECT_EQ(healthOfRaw(raw).volume, 0);

  raw = cube();
  raw.triangles[0] = fcl::Triangle(raw.triangles[0][1], raw.triangles[0][0], raw.triangles[0][2]);
  EXPECT_EQ(healthOfRaw(raw).flipped_edges, 3u);
  EXPECT_TRUE(healthOfRaw(raw).watertight());
  EXPECT_FALSE(healthOfRaw(raw).oriented());

  raw = cube();
  raw.triangles.emplace_back(raw.triangles[0][2], raw.triangles[0][0], raw.triangles[0][1]);
  EXPECT_EQ(healthOfRaw(raw).duplicate_triangles, 1u);
  EXPECT_EQ(healthOfRaw(raw).non_manifold_edges, 3u);

  raw = cube();
  raw.vertices.emplace_back(9, 9, 9);
  EXPECT_EQ(healthOfRaw(raw).unused_vertices, 1u);
  raw.triangles.emplace_back(0, 0, 1);  // a segment
  raw.triangles.emplace_back(2, 2, 2);  // a point
  EXPECT_EQ(healthOfRaw(raw).degenerate_triangles, 2u);
  EXPECT_TRUE(healthOfRaw(raw).watertight()) << "what has no three corners has no edges";

  raw = cube();
  raw.add(test::box({5, 5, 5}, {6, 6, 6}));
  EXPECT_EQ(healthOfRaw(raw).components, 2u);
  EXPECT_EQ(healthOfRaw(test::adversarial()).degenerate_triangles,
            healthOfRaw(test::unwelded(test::adversarial())).degenerate_triangles);
}

TEST(Health, LocatesEachFault) {
  test::Raw raw = cube();
  raw.triangles.pop_back();
  const fcl::Triangle first = raw.triangles[0];
  raw.triangles.emplace_back(first[2], first[0], first[1]);
  raw.triangles.emplace_back(0, 0, 1);
  raw.vertices.emplace_back(9, 9, 9);
  raw.vertices.push_back(raw.vertices[3]);
  const program::Health health = healthOfRaw(raw);
  const program::Faults& faults = health.faults;
  const std::uint32_t count = static_cast<std::uint32_t>(raw.triangles.size());
  EXPECT_EQ(faults.duplicate_triangles, std::vector<std::uint32_t>{count - 2});
  EXPECT_EQ(faults.degenerate_triangles, std::vector<std::uint32_t>{count - 1});
  EXPECT_EQ(faults.unused_vertices, (std::vector<std::uint32_t>{8, 9}));
  EXPECT_EQ(faults.repeated_vertices, std::vector<std::uint32_t>{9});
  ASSERT_EQ(faults.open_edges.size(), health.open_edges);
  for (const program::FaultyEdge& edge : faults.open_edges) {
    ASSERT_EQ(edge.triangles.size(), 1u);
    const fcl::Triangle& t = raw.triangles[edge.triangles[0]];
    const std::set<std::size_t> corners{t[0], t[1], t[2]};
    EXPECT_TRUE(corners.count(edge.vertices[0]) == 1 && corners.count(edge.vertices[1]) == 1);
  }
  for (const program::FaultyEdge& edge : faults.non_manifold_edges) {
    EXPECT_EQ(std::count(edge.triangles.begin(), edge.triangles.end(), 0u), 1);
    EXPECT_EQ(std::count(edge.triangles.begin(), edge.triangles.end(), count - 2), 1);
  }
  // An edge each of the open and the crowded, three of either triangle.
  EXPECT_EQ(program::faultLines(faults, *raw.mesh()).size(), health.open_edges + health.non_manifold_edges + 6);
}

TEST(Health, AgreesWithACountByMaps) {
  std::mt19937 g(7);
  for (int round = 0; round < 40; ++round) {
    // A torus with holes, some triangles turned and some twice, in any order.
    test::Raw raw = test::torus(8);
    std::shuffle(raw.triangles.begin(), raw.triangles.end(), g);
    raw.triangles.resize(raw.triangles.size() - g() % 100);
    for (std::size_t i = 0; i < g() % 20; ++i) {
      const fcl::Triangle t = raw.triangles[g() % raw.triangles.size()];
      raw.triangles.emplace_back(t[1], t[0], t[2]);
    }
    std::map<std::set<std::size_t>, std::vector<bool>> edges;
    std::set<std::set<std::size_t>> distinct;
    for (const fcl::Triangle& t : raw.triangles) {
      distinct.insert({t[0], t[1], t[2]});
      for (std::size_t k = 0; k < 3; ++k) edges[{t[k], t[(k + 1) % 3]}].push_back(t[k] < t[(k + 1) % 3]);
    }
    std::array<std::size_t, 3> expected{};
    for (const auto& [edge, uses] : edges) {
      expected[0] += uses.size() == 1;
      expected[1] += uses.size() > 2;
      expected[2] += uses.size() == 2 && uses[0] == uses[1];
    }
    const Health health = healthOfRaw(raw);
    EXPECT_EQ((std::array<std::size_t, 3>{health.open_edges, health.non_manifold_edges, health.flipped_edges}),
              expected);
    EXPECT_EQ(health.duplicate_triangles, raw.triangles.size() - distinct.size());
  }
}

TEST(DisplayMesh, KeepsASmallMeshAndMakesALargeOneCoarser) {
  const auto mesh = test::torus(64).scale(1e-3).move({1e3, -5, 0}).mesh();
  const program::DisplayMesh all = program::displayMesh(*mesh, 1u << 20);
  ASSERT_EQ(all.triangles(), mesh->triangleCount());
  const double size = program::displaySize(*mesh);
  for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      const Eigen::Vector3d& corner = mesh->vertex(mesh->indices(t)[c]);
      for (std::size_t k = 0; k < 3; ++k) {
        const double shown = (all.positions[3 * all.indices[3 * t + c] + k] / 65535.0 - 0.5) * size;
        EXPECT_NEAR(shown + mesh->bounds().center()[static_cast<int>(k)], corner[static_cast<int>(k)], size * 1e-5);
      }
    }
  }
  const program::DisplayMesh few = program::displayMesh(*mesh, 1000);
  EXPECT_LE(few.triangles(), 1000u);
  EXPECT_GT(few.triangles(), 100u);
  for (const std::uint32_t i : few.indices) ASSERT_LT(3 * i + 2, few.positions.size());
}

TEST(DisplayMesh, OfAPoint) {
  test::Raw raw;
  raw.vertices.emplace_back(1, 2, 3);
  raw.triangles.emplace_back(0, 0, 0);
  EXPECT_EQ(program::displayMesh(*raw.mesh(), 10).triangles(), 0u);
  EXPECT_EQ(program::displaySize(*raw.mesh()), 1);
}

/// Every dimension and subdivision: a page draws the boxes that the spheres are about.
TEST(Page, BoxesAreThoseOfTheSpheres) {
  for (const test::Raw& raw : {test::torus(16), test::adversarial(), test::soup(200, 3).move({100, -50, 7})}) {
    const auto mesh = raw.mesh();
    for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
      for (const double dimension : {0.0, 514.0, 768.0, 832.5, 1024.0}) {
        Options options;
        options.subdivision = subdivision;
        options.dimension = dimension;
        Modeld model(mesh, options);
        model.expandAll(5);
        model.visit([&](const NodeView& node) {
          const Eigen::Vector3d half = program::halfRegion(node, *mesh, subdivision, dimension);
          EXPECT_NEAR(half.norm(), node.radius, 1e-9 * mesh->bounds().diagonal().norm());
        });
      }
    }
  }
}

/// The scene of a page as its script reads it.
program::Json sceneOf(const program::Page& page) {
  const std::string html = page.html();
  const std::string before = "<script type=\"application/json\" id=\"scene\">";
  const std::size_t begin = html.find(before) + before.size();
  return program::Json::parse(html.substr(begin, html.find("</script>", begin) - begin));
}

TEST(Numbers, AreWrittenWhateverTheyAre) {
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(program::formatNumber(123.456), "123");
  EXPECT_EQ(program::formatNumber(0), "0.00");
  EXPECT_EQ(program::formatNumber(-infinity), "-inf");
  EXPECT_EQ(program::formatRatio(12.34), "12.3 x");
  EXPECT_EQ(program::formatRatio(infinity), "-");
  EXPECT_EQ(program::formatRatio(infinity - infinity), "-");
}

TEST(Page, LeavesOutWhatIsTooMuchAndSaysSo) {
  const auto mesh = test::box({0, 0, 0}, {1, 1, 1}).mesh();
  program::Page page("</script><b>");
  page.object("box", *mesh);
  std::vector<NodeView> nodes(1);
  NodeView node;
  node.level = 2;
  nodes.resize(1 + program::Page::kMaxNodes, node);
  page.tree(*mesh, nodes, Subdivision::kOctree, 0);
  nodes.pop_back();
  page.tree(*mesh, nodes, Subdivision::kBono, 0);
  page.contacts(std::vector<program::TouchingPoint>(program::Page::kMaxContacts + 5), false);
  const program::Json scene = sceneOf(page);
  EXPECT_EQ(scene.at("title"), "</script><b>");
  const program::Json& trees = scene.at("objects")[0].at("trees");
  EXPECT_EQ(trees[0].at("levels"), 1) << "one node more than fits";
  EXPECT_EQ(trees[0].at("counts"), program::Json({1, program::Page::kMaxNodes}));
  EXPECT_EQ(trees[1].at("levels"), 2);
  EXPECT_EQ(trees[1].at("level_of").get<std::string>().size(), (program::Page::kMaxNodes + 2) / 3 * 4);
  EXPECT_EQ(scene.at("contacts").at("total"), program::Page::kMaxContacts + 5);
  EXPECT_EQ(scene.at("contacts").at("of"), "cells");
  EXPECT_EQ(scene.at("contacts").at("numbers").get<std::string>().size(),
            (program::Page::kMaxContacts * 72 + 2) / 3 * 4);
}

TEST(Spheres, HoldTheSurface) {
  const auto mesh = test::torus(24).mesh();
  Options options;
  options.dimension = 12;  // whole units, so branches end before the depth
  for (const double dimension : {0.0, 12.0}) {
    options.dimension = dimension;
    Modeld model(mesh, options);
    model.expandAll(6);
    std::vector<NodeView> nodes;
    model.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
    for (int level = 1; level <= 6; ++level) {
      const std::vector<NodeView> leaves = program::leavesAt(nodes, level);
      for (const Mesh::Indices& t : mesh->triangles()) {
        const Eigen::Vector3d p = (mesh->vertex(t[0]) + mesh->vertex(t[1]) + mesh->vertex(t[2])) / 3;
        EXPECT_TRUE(
            std::any_of(leaves.begin(), leaves.end(),
                        [&](const NodeView& node) { return (p - node.center).norm() <= node.radius * (1 + 1e-12); }))
            << "level " << level;
      }
    }
  }
}

TEST(SphereFit, HoldsTheSurfaceAndKeepsTheTolerance) {
  for (const test::Raw& raw : {cube(), test::torus(12), test::adversarial()}) {
    const auto mesh = raw.mesh();
    const double size = mesh->bounds().sizes().norm();
    std::vector<double> protrusions;  // a cut may turn one sphere into two that protrude more, but not for long
    for (const std::size_t count : {1u, 2u, 7u, 50u}) {
      const program::SphereFit fit = program::fitSpheres(*mesh, count, 0);
      EXPECT_LE(fit.spheres.size(), count);
      EXPECT_EQ(fit.coverage, 1);
      EXPECT_LE(fit.average_protrusion, fit.protrusion);
      protrusions.push_back(fit.protrusion);
      // Each corner of each triangle, its centre and its edges' middles are held.
      for (std::size_t t = 0; t < mesh->triangleCount(); ++t) {
        const fcl::Triangle c = mesh->triangle(t);
        for (int i = 0; i < 7; ++i) {
          Eigen::Vector3d p = (mesh->vertex(c[0]) + mesh->vertex(c[1]) + mesh->vertex(c[2])) / 3;
          if (i < 3) p = mesh->vertex(c[i]);
          if (i >= 4) p = (mesh->vertex(c[i - 4]) + mesh->vertex(c[(i - 3) % 3])) / 2;
          double outside = size;
          for (const program::Sphere& s : fit.spheres) outside = std::min(outside, (p - s.center).norm() - s.radius);
          EXPECT_LE(outside, 1e-9 * size);
        }
      }
    }
    if (mesh->triangleCount() != test::adversarial().triangles.size()) {
      EXPECT_LT(protrusions.back(), 0.6 * protrusions.front());
    }
    const program::SphereFit fine = program::fitSpheres(*mesh, 0, size / 10);
    EXPECT_LE(fine.protrusion, size / 10);
  }
  // The ball about a cube: its corners are on it, and it protrudes most above the middle of a face.
  const program::SphereFit one = program::fitSpheres(*test::box({4, 4, 4}, {6, 6, 6}).mesh(), 1, 0);
  EXPECT_NEAR(one.spheres.at(0).radius, std::sqrt(3.0), 0.05);
  EXPECT_NEAR(one.protrusion, std::sqrt(3.0) - 1, 0.1);
}

TEST(Protrusion, IsATightBoundFromAbove) {
  constexpr int kSamples = 20000;
  std::mt19937 g(3);
  std::uniform_real_distribution<double> any(-1, 1);
  for (const test::Raw& raw : {test::box({0, 0, 0}, {1, 1, 1}), cube(), test::torus(8)}) {
    const std::vector<program::BoundedTriangle> triangles = program::boundedTriangles(*raw.mesh());
    std::vector<std::uint32_t> all(triangles.size());
    std::iota(all.begin(), all.end(), 0u);
    for (int round = 0; round < 12; ++round) {
      Eigen::Vector3d center = raw.mesh()->bounds().center();
      if (round > 0) center += Eigen::Vector3d(any(g), any(g), any(g));
      const double radius = round == 0 ? std::sqrt(0.75) : std::pow(10, any(g) - 0.5);
      double greatest = 0;
      for (int i = 0; i < kSamples; ++i) {
        const double z = 1 - (2 * i + 1.0) / kSamples, r = std::sqrt(1 - z * z),
                     angle = M_PI * (3 - std::sqrt(5.0)) * i;
        const Eigen::Vector3d s = center + radius * Eigen::Vector3d(r * std::cos(angle), r * std::sin(angle), z);
        double least = std::numeric_limits<double>::max();
        for (const program::BoundedTriangle& t : triangles)
          least = std::min(least, (program::closestOnTriangle(s, t) - s).norm());
        greatest = std::max(greatest, least);
      }
      const double bound = program::protrusionOf(center, radius, triangles, all);
      EXPECT_GE(bound, greatest * (1 - 1e-12));
      EXPECT_LE(bound, greatest * 1.02);
      // Where less is enough to know, the bound stays one.
      EXPECT_GE(program::protrusionOf(center, radius, triangles, all, greatest / 2), greatest * (1 - 1e-12));
    }
  }
  // Above the middle of each face.
  const auto box = test::box({0, 0, 0}, {1, 1, 1}).mesh();
  std::vector<std::uint32_t> all(box->triangleCount());
  std::iota(all.begin(), all.end(), 0u);
  const double bound = program::protrusionOf({0.5, 0.5, 0.5}, std::sqrt(0.75), program::boundedTriangles(*box), all);
  EXPECT_GE(bound, std::sqrt(0.75) - 0.5);
  EXPECT_LE(bound, 1.01 * (std::sqrt(0.75) - 0.5));
  EXPECT_EQ(program::protrusionOf({0, 0, 0}, 0, program::boundedTriangles(*box), all), 0);
}

TEST(BeyondLimits, AreDegenerateTrianglesAndLargeCoordinatesInFloat) {
  using program::beyondLimits;
  using program::Scalar;
  const auto sound = cube().mesh();
  EXPECT_EQ(beyondLimits({sound.get(), sound.get()}, Scalar::kDouble), "");
  EXPECT_EQ(beyondLimits({sound.get(), sound.get()}, Scalar::kFloat), "");
  test::Raw raw = cube();
  raw.triangles.emplace_back(0, 1, 1);
  const auto degenerate = raw.mesh();
  EXPECT_EQ(beyondLimits({sound.get(), degenerate.get()}, Scalar::kDouble),
            "the meshes have 1 degenerate triangle; share/doc/guarantees.md, Limits, describes how answers about them "
            "may differ");
  // A height of 1e-6 of the length is little in float only.
  raw = cube();
  raw.vertices.emplace_back(0.5, 1e-6, 0);
  raw.vertices.emplace_back(0, 0, 0);
  raw.vertices.emplace_back(1, 0, 0);
  const std::size_t last = raw.vertices.size() - 1;
  raw.triangles.emplace_back(last - 2, last - 1, last);
  const auto narrow = raw.mesh();
  EXPECT_EQ(beyondLimits({narrow.get()}, Scalar::kDouble), "");
  EXPECT_NE(beyondLimits({narrow.get()}, Scalar::kFloat).find("1 degenerate triangle (in float)"), std::string::npos);
  const auto large = test::box({0, 0, 0}, {1e12, 1e12, 1e12}).mesh();
  EXPECT_EQ(beyondLimits({large.get()}, Scalar::kDouble), "");
  EXPECT_NE(beyondLimits({large.get()}, Scalar::kFloat).find("coordinates above 1e9"), std::string::npos);
}

TEST(Printable, KeepsCharactersButNoControls) {
  using program::printable;
  EXPECT_EQ(printable("Gelenk\u00e4 \u20ac \U0001F916 ~"), "Gelenk\u00e4 \u20ac \U0001F916 ~");
  EXPECT_EQ(printable(std::string("a\x1b[31m\a\nb\0\x7f", 11)), "a?[31m??b??");
  EXPECT_EQ(printable("\xc2\x80|\xc2\x9b|\xc2\xa0"), "?|?|\xc2\xa0") << "C1 controls";
  for (const char* invalid : {"\xff", "\x80", "\xc3", "\xe4"}) EXPECT_EQ(printable(invalid), "?") << invalid;
  EXPECT_EQ(printable("\xc0\xaf"), "??") << "too long";
  EXPECT_EQ(printable("\xed\xa0\x80"), "???") << "a surrogate";
  EXPECT_EQ(printable("\xf4\x90\x80\x80"), "????") << "beyond Unicode";
  EXPECT_EQ(printable("\xe2\x82"
                      "a"),
            "??a")
      << "cut short";
  EXPECT_EQ(printable(""), "");
  // Cut, but not within a character.
  EXPECT_EQ(program::inQuotes(std::string(60, 'x')), "'" + std::string(60, 'x') + "'");
  EXPECT_EQ(program::inQuotes(std::string(61, 'x')), "'" + std::string(60, 'x') + "...'");
  EXPECT_EQ(program::inQuotes(std::string(59, 'x') + "\u00e4"), "'" + std::string(59, 'x') + "...'");
  EXPECT_EQ(program::characters("\u00e4\u20ac."), 3u);
}

TEST(Format, ExactGivesTheNumberBack) {
  EXPECT_EQ(program::formatExact(M_PI), "3.141592653589793");
  EXPECT_EQ(program::formatExact(0.05), "0.05");
  EXPECT_EQ(program::formatExact(-2), "-2");
}

TEST(Progress, SaysHowLongItTakesYet) {
  EXPECT_EQ(program::timeLeft(1, 100, 1), "");
  EXPECT_EQ(program::timeLeft(0, 100, 10), "");
  EXPECT_EQ(program::timeLeft(10, 100, 5), ", about 45 s left");
  EXPECT_EQ(program::timeLeft(10, 100, 60), ", about 9 min left");
  EXPECT_EQ(program::timeLeft(1, 100, 3600), ", about 99 h left");
  EXPECT_EQ(program::timeLeft(100, 100, 60), "");
}

TEST(Suggestion, IsTheNearestName) {
  const std::vector<std::string> names{"collide", "inspect", "--pose", "--poses"};
  EXPECT_EQ(program::suggestion("colide", names), " Did you mean collide?");
  EXPECT_EQ(program::suggestion("clolide", names), " Did you mean collide?");
  EXPECT_EQ(program::suggestion("--psoes", names), " Did you mean --poses?");
  EXPECT_EQ(program::suggestion("insp", names), " Did you mean inspect?");
  EXPECT_EQ(program::suggestion("fly", names), "");
  EXPECT_EQ(program::suggestion("", names), "");
}

TEST(Pose, IsSevenNumbersAndNothingElse) {
  using program::Pose;
  EXPECT_EQ(Pose::parse("1,2,3,0,1,0,0").text(), "1,2,3,0,1,0,0");
  for (const char* bad :
       {"1,2,3,0,1,0,0,", "1,2,3,0,1,0,0 ", "1,2,3,0,1,0,0x", "1,2,3,0,1,0,0,4", "1,2,3,0,1,0", "", "1,2,3,0,1,0,",
        "1,2,3,0,1,0,nan", "inf,2,3,0,1,0,0", "1,2,3,0,0,0,0", "1,2,3,1e-200,0,0,0", "1,2,3,1e200,0,0,0"}) {
    EXPECT_THROW(Pose::parse(bad), std::invalid_argument) << bad;
  }
}

/// Touches where the origins of A and B are near, whatever the meshes are.
class Near : public program::QueryPair {
 public:
  static constexpr double kDistance = 1.25;
  bool touch(const Eigen::Isometry3d& X_AB, Order) const override { return X_AB.translation().norm() <= kDistance; }
  std::vector<Contact> contacts(const Eigen::Isometry3d&, std::size_t, Order) const override { return {}; }
  std::size_t countContacts(const Eigen::Isometry3d&) const override { return 0; }
  double distance(const Eigen::Isometry3d&) const override { return 0; }
};

TEST(PoseSampler, LiesToBothSidesOfContact) {
  const Near reference;
  const auto a = test::box({-1, -1, -1}, {1, 1, 1}).mesh(), b = test::box({-2, -1, -1}, {2, 1, 1}).mesh();
  program::PoseSampler sampler(*a, *b, reference, 5);
  double nearest = 1, farthest = 0;
  for (std::uint64_t ray = 0; ray < 50; ++ray) {
    const auto poses = sampler.aroundContact(ray);
    for (std::size_t i = 0; i < 6; ++i) {
      const double off = poses[i].transform().translation().norm() - Near::kDistance;
      EXPECT_EQ(off > 0, i % 2 != 0) << off;
      EXPECT_GE(std::abs(off), 0x1p-31 * sampler.smallerRadius());
      EXPECT_LE(std::abs(off), 0x1p-2 * sampler.smallerRadius());
      nearest = std::min(nearest, std::abs(off));
      farthest = std::max(farthest, std::abs(off));
    }
  }
  EXPECT_LT(nearest, 1e-8);
  EXPECT_GT(farthest, 1e-2);
}

// Their Morton codes have more than 32 bits.
TEST(QueryPair, NamesDeepCellsAsFclContactsDo) {
  using namespace program;
  Options options;
  options.oracle = OracleKind::kCpu;
  options.answer = Answer::kConservative;
  options.depth = 14;
  const auto mesh = test::box({0, 0, 0}, {1, 1, 1}).mesh();
  const MeshArrays arrays(*mesh, Scalar::kDouble);
  Eigen::Isometry3d X_AB = Eigen::Isometry3d::Identity();
  X_AB.translation() = Eigen::Vector3d(0.99, 0.97, 0.98);
  const std::unique_ptr<BocstPair> pair = makeBocstPair(Scalar::kDouble, arrays, arrays, options);
  const std::vector<TouchingPoint> points = pair->touchingPoints(X_AB, 5);

  const Modeld a(mesh, options), b(mesh, options);
  const fcl::CollisionRequestd request(5, true);
  fcl::CollisionResultd result;
  fcl::collide<double>(&a, fcl::Transform3d::Identity(), &b, fcl::Transform3d(X_AB.matrix()), request, result);
  ASSERT_EQ(points.size(), result.numContacts());
  ASSERT_FALSE(points.empty());
  std::int64_t largest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_EQ(points[i].triangles.first, result.getContact(i).b1);
    EXPECT_EQ(points[i].triangles.second, result.getContact(i).b2);
    largest = std::max(largest, points[i].triangles.first);
  }
  EXPECT_GT(largest, std::int64_t{1} << 32);
  const std::vector<QueryPair::Contact> ids = pair->contacts(X_AB, 5);
  EXPECT_EQ(ids.size(), points.size());
  for (const TouchingPoint& point : points) EXPECT_EQ(std::count(ids.begin(), ids.end(), point.triangles), 1);
}

TEST(Pose, SaysItsRotationInWords) {
  const auto words = [](const std::string& rpy) {
    return program::Pose::parse(rpy, program::RotationFormat::kRpy).rotationText();
  };
  EXPECT_EQ(words("1,2,3,0,0,0"), "not turned");
  EXPECT_EQ(words("0,0,0,0,0,-1.5707963267948966"), "turned by -90 degrees about (0, 0, 1)");
  EXPECT_EQ(words("0,0,0,3.1415926535897931,0,0"), "turned by 180 degrees about (1, 0, 0)");
}

TEST(Spheres, KeepFloatsFloatsInYaml) {
  NodeView node;
  node.center = {1e-5, 1e22, -3};
  node.radius = 0.5;
  const std::string text = program::sphereFile("a.yaml", program::spheresOf({node}), "a \"b\"");
  EXPECT_NE(text.find("1.0e+22, -3]"), std::string::npos) << text;
  EXPECT_NE(text.find("\"a \\\"b\\\"\":"), std::string::npos) << text;
  EXPECT_THROW(program::checkSphereFile("a.txt"), std::invalid_argument);
  EXPECT_NO_THROW(program::checkSphereFile("a.PLY"));
}

program::Pose poseOf(double x) {
  program::Pose pose;
  pose.numbers[0] = x;
  return pose;
}

TEST(Shard, IsReadAsItIsWritten) {
  EXPECT_EQ(program::Shard::parse("3/7").index, 3u);
  EXPECT_EQ(program::Shard::parse("3/7").of, 7u);
  for (const char* text : {"", "/", "0/3", "4/3", "1", "1/", "/2", "a/b", "-1/3", "1/3x", "1/99999999999", "1.0/2"}) {
    EXPECT_THROW(program::Shard::parse(text), std::invalid_argument) << text;
  }
}

TEST(Overestimate, HasABinForEachDistance) {
  using program::Overestimate;
  EXPECT_EQ(Overestimate::binOf(0), 0u);
  EXPECT_EQ(Overestimate::binOf(0.99e-6), 0u);
  EXPECT_EQ(Overestimate::binOf(1.01e-6), 1u);
  EXPECT_EQ(Overestimate::binOf(0.05), 5u);
  EXPECT_EQ(Overestimate::binOf(0.5), 6u);
  EXPECT_EQ(Overestimate::binOf(1e9), 7u);
  EXPECT_EQ(Overestimate::binName(Overestimate::binOf(0.05)), "< 1e-1");
  EXPECT_EQ(Overestimate::binName(Overestimate::binOf(0.5)), "< 1");
}

TEST(Validation, PartsAddUpToTheWhole) {
  using program::Validation;
  std::mt19937 g(5);
  for (int round = 0; round < 50; ++round) {
    const std::size_t of = 1 + g() % 5;
    Validation whole;
    whole.settings = {{"seed", 1}, {"contacts_compared", false}, {"options", {{"scalar", "double"}}}};
    whole.overestimates.resize(2);
    std::vector<Validation> parts(of, whole);
    for (std::size_t i = 0; i < of; ++i) parts[i].shard = {i + 1, of};
    for (std::size_t number = 0; number < 200; ++number) {
      // Few values, so that the largest is met more than once.
      const double value = static_cast<double>(g() % 4);
      const bool fails = g() % 6 == 0;
      for (Validation* sum : {&whole, &parts[number / 8 % of]}) {
        ++sum->count[Validation::kPoses];
        if (fails) sum->fail(number, poseOf(value), "false negative");
        sum->overestimates[number % 2].add(value, number, poseOf(static_cast<double>(number)));
      }
    }
    std::shuffle(parts.begin(), parts.end(), g);
    std::vector<Validation> read;
    for (const Validation& part : parts) read.push_back(Validation::fromJson(program::Json::parse(part.json().dump())));
    EXPECT_EQ(Validation::merged(read).json(), whole.json());
    EXPECT_THROW(Validation::merged(read).throwIfWrong(), std::runtime_error);
    if (of == 1) continue;
    std::vector<Validation> some(read.begin() + 1, read.end());
    EXPECT_THROW(Validation::merged(some), std::runtime_error);
    some.push_back(some.front());
    EXPECT_THROW(Validation::merged(some), std::runtime_error);
    read.back().settings["seed"] = 2;
    EXPECT_THROW(Validation::merged(read), std::runtime_error);
  }
}

}  // namespace
}  // namespace bocst
