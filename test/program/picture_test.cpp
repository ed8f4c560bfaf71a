// SPDX-License-Identifier: BSD-3-Clause
// What is in pictures, by projections computed here.
#include "picture/picture.h"

#include <bocst/model.h>
#include <bocst/oracle.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "mesh/spheres.h"
#include "meshes.h"
#include "picture/inspect_picture.h"
#include "picture/marks.h"
#include "picture/pair_picture.h"
#include "render/renderer.h"

namespace bocst {
namespace {

using program::Picture;
using render::Image;
using render::Renderer;
using render::Scene;
using render::Surface;
using render::View;
using render::Volumes;

constexpr render::Color kRed = {1, 0, 0}, kBlue = {0, 0, 1};

/// How much of each pixel is covered: of 3 x 3 samples.
struct Coverage {
  explicit Coverage(int of) : side(of), samples(static_cast<std::size_t>(9 * of * of)) {}

  /// Samples with 0 <= x, y < 3 * side for which inside(x, y), in pixels from the upper left corner.
  template <typename Inside>
  void add(Eigen::Vector2d lo, Eigen::Vector2d hi, const Inside& inside) {
    const auto index = [this](double pixel) {
      return std::clamp(static_cast<int>(std::floor(3 * pixel)), 0, 3 * side - 1);
    };
    for (int y = index(lo.y()); y <= index(hi.y()); ++y) {
      for (int x = index(lo.x()); x <= index(hi.x()); ++x) {
        if (inside(Eigen::Vector2d((x + 0.5) / 3, (y + 0.5) / 3)))
          samples[static_cast<std::size_t>(y * 3 * side + x)] = true;
      }
    }
  }

  double of(int x, int y) const {
    int count = 0;
    for (int i = 0; i < 9; ++i) count += samples[static_cast<std::size_t>((3 * y + i / 3) * 3 * side + 3 * x + i % 3)];
    return count / 9.0;
  }

  int side;
  std::vector<bool> samples;
};

Eigen::Vector2d pixelOf(const View& view, const Eigen::Vector3d& point, int side) {
  const Eigen::Vector3d d = (point - view.center) / view.radius;
  return {(1 + view.axes.row(0).dot(d)) * side / 2, (1 - view.axes.row(1).dot(d)) * side / 2};
}

void addTriangles(Coverage& coverage, const Mesh& mesh, const Eigen::Isometry3d& pose, const View& view) {
  for (const Mesh::Indices& t : mesh.triangles()) {
    std::array<Eigen::Vector2d, 3> c;
    Eigen::AlignedBox2d box;
    for (std::size_t k = 0; k < 3; ++k) box.extend(c[k] = pixelOf(view, pose * mesh.vertex(t[k]), coverage.side));
    const auto area = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& p) {
      return (b - a).x() * (p - a).y() - (b - a).y() * (p - a).x();
    };
    const double sign = area(c[0], c[1], c[2]) < 0 ? -1 : 1;
    coverage.add(box.min(), box.max(), [&](const Eigen::Vector2d& p) {
      return sign * area(c[0], c[1], p) >= 0 && sign * area(c[1], c[2], p) >= 0 && sign * area(c[2], c[0], p) >= 0;
    });
  }
}

void addDisc(Coverage& coverage, const Eigen::Vector3d& center, double radius, const View& view) {
  const Eigen::Vector2d at = pixelOf(view, center, coverage.side);
  const double r = radius / view.radius * coverage.side / 2;
  coverage.add(at.array() - r, at.array() + r, [&](const Eigen::Vector2d& p) { return (p - at).norm() <= r; });
}

double alphaOf(const Image& image, int x, int y) {
  return (image.pixels[static_cast<std::size_t>(y * image.width + x)] >> 24) / 255.0;
}

/// Rasterisers may differ about a sample on an edge, and in its last bits.
void expectCovers(const Image& image, const Coverage& expected) {
  ASSERT_EQ(image.width, expected.side);
  ASSERT_EQ(image.height, expected.side);
  double worst = 0, sum = 0, difference = 0;
  for (int y = 0; y < expected.side; ++y) {
    for (int x = 0; x < expected.side; ++x) {
      const double off = std::abs(alphaOf(image, x, y) - expected.of(x, y));
      worst = std::max(worst, off);
      difference += off;
      sum += expected.of(x, y);
    }
  }
  EXPECT_GT(sum, 0);
  EXPECT_LE(worst, 3.1 / 9);
  EXPECT_LE(difference, 0.002 * sum + 1);
}

/// From a random side, with all of a ball of radius 1 about the center in it.
View randomView(std::mt19937& g, const Eigen::Vector3d& center = Eigen::Vector3d::Zero()) {
  std::normal_distribution<double> normal;
  View view;
  view.axes = Eigen::Quaterniond(normal(g), normal(g), normal(g), normal(g)).normalized().toRotationMatrix();
  view.center = center;
  view.radius = 1.3;
  view.reach = 3;
  return view;
}

std::shared_ptr<const Mesh> meshOf(const std::vector<Eigen::Vector3d>& vertices) {
  return std::make_shared<const Mesh>(vertices, std::vector<fcl::Triangle>{{0, 1, 2}});
}

std::shared_ptr<const Mesh> pointAt(const Eigen::Vector3d& p) { return meshOf({p, p, p}); }

class Pictures : public testing::Test {
 protected:
  static void SetUpTestSuite() { renderer_ = std::make_unique<Renderer>(OracleKind::kCpu); }
  static void TearDownTestSuite() { renderer_.reset(); }

  static Renderer& renderer() { return *renderer_; }
  static Image draw(const Scene& scene, const View& view, int side) { return renderer().draw(scene, view, side, side); }

 private:
  static std::unique_ptr<Renderer> renderer_;
};

std::unique_ptr<Renderer> Pictures::renderer_;

TEST(View, StandsUpright) {
  for (const render::Up up : {render::Up::kY, render::Up::kZ}) {
    const Eigen::Vector3d upwards = up == render::Up::kY ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
    for (const double turn : {0.0, 0.7, 2.0, -3.0}) {
      for (const double tilt : {-1.2, 0.0, 0.45}) {
        const Eigen::Matrix3d axes = View::axesFrom(turn, tilt, up);
        EXPECT_TRUE((axes * axes.transpose()).isIdentity(1e-12));
        EXPECT_NEAR(axes.determinant(), 1, 1e-12);
        EXPECT_NEAR(axes.row(0).dot(upwards), 0, 1e-12);
        EXPECT_NEAR(axes.row(1).dot(upwards), std::cos(tilt), 1e-12);
        EXPECT_NEAR(axes.row(2).dot(upwards), std::sin(tilt), 1e-12);
      }
    }
  }
}

TEST_F(Pictures, SurfacesCoverTheirProjection) {
  std::mt19937 g(1);
  const std::vector<std::shared_ptr<const Mesh>> meshes = {test::torus(24).mesh(),
                                                           test::box({-0.5, -0.3, -0.7}, {0.5, 0.6, 0.1}).mesh(),
                                                           meshOf({{-0.5, 0, 0}, {0.7, 0.2, 0.1}, {0, -0.6, 0.6}})};
  for (const auto& mesh : meshes) {
    for (const double away : {0.0, 1e6}) {
      View view = randomView(g);
      view.center.x() += away;
      Surface surface;
      surface.mesh = mesh.get();
      surface.color = kRed;
      surface.pose = Eigen::Translation3d(away, 0, 0) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY());
      const Image image = draw({{surface}, {}}, view, 97);
      Coverage expected(97);
      addTriangles(expected, *mesh, surface.pose, view);
      expectCovers(image, expected);
    }
  }
}

TEST_F(Pictures, SpheresCoverTheirDiscs) {
  std::mt19937 g(2);
  std::uniform_real_distribution<double> any(-0.7, 0.7);
  for (const std::size_t count : {1, 7, 300}) {
    const View view = randomView(g, {3, -2, 1});
    Volumes spheres;
    spheres.pose = Eigen::Translation3d(view.center) * Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ());
    Coverage expected(120);
    for (std::size_t i = 0; i < count; ++i) {
      spheres.all.push_back({{any(g), any(g), any(g)}, {0, 0, 0}, 0.02 + 0.1 * (any(g) + 0.7)});
      addDisc(expected, spheres.pose * spheres.all.back().center, spheres.all.back().radius, view);
    }
    expectCovers(draw({{}, {spheres}}, view, 120), expected);
  }
}

TEST_F(Pictures, BoxesCoverTheirFaces) {
  std::mt19937 g(3);
  for (int i = 0; i < 4; ++i) {
    const View view = randomView(g);
    Volumes boxes;
    boxes.shape = Volumes::Shape::kBoxes;
    boxes.pose = Eigen::AngleAxisd(i, Eigen::Vector3d(1, 2, 3).normalized());
    boxes.all = {{{0.2, 0.1, -0.1}, {0.5, 0.2, 0.3}, 0}, {{-0.5, 0, 0.4}, {0.1, 0.2, 0.1}, 0}};
    Coverage expected(120);
    for (const Volumes::Volume& box : boxes.all) {
      addTriangles(expected, *test::box(box.center - box.half, box.center + box.half).mesh(), boxes.pose, view);
    }
    expectCovers(draw({{}, {boxes}}, view, 120), expected);
  }
}

TEST_F(Pictures, WhatIsNearerHidesWhatIsNot) {
  const auto mesh = test::box({-0.5, -0.5, -0.1}, {0.5, 0.5, 0.1}).mesh();
  View view;
  view.reach = 2;
  const auto middle = [&](double z, float sphere_opacity, float mesh_opacity) {
    Volumes sphere;
    sphere.color = kBlue;
    sphere.opacity = sphere_opacity;
    sphere.all = {{{0, 0, z}, {0.2, 0.2, 0.2}, 0.2}};
    const Image image = draw({{{mesh.get(), Eigen::Isometry3d::Identity(), kRed, mesh_opacity}}, {sphere}}, view, 31);
    const std::uint32_t pixel = image.pixels[15 * 31 + 15];
    return std::pair<bool, bool>((pixel >> 16 & 255) > 40, (pixel & 255) > 40);  // red, blue
  };
  using P = std::pair<bool, bool>;
  EXPECT_EQ(middle(0.6, 1, 1), P(false, true));     // before the mesh
  EXPECT_EQ(middle(-0.6, 1, 1), P(true, false));    // behind it
  EXPECT_EQ(middle(0.6, 0.5f, 1), P(true, true));   // the mesh shows through
  EXPECT_EQ(middle(-0.6, 1, 0.4f), P(true, true));  // glass before the sphere
  EXPECT_EQ(middle(0.6, 1, 0.4f), P(false, true));  // and behind it
}

TEST_F(Pictures, WhatHasNoAreaIsSeen) {
  std::mt19937 g(4);
  const View view = randomView(g);
  const Eigen::Vector3d a(-0.5, 0.1, 0.2), b(0.4, -0.3, 0.5);
  const Eigen::Vector3d middle = (a + b) / 2;
  const std::vector<std::pair<std::shared_ptr<const Mesh>, std::pair<Eigen::Vector3d, Eigen::Vector3d>>> cases = {
      {pointAt(a), {a, a}}, {meshOf({a, middle, b}), {a, b}}, {meshOf({b, b, a}), {a, b}}, {meshOf({b, a, b}), {a, b}}};
  for (const auto& [mesh, ends] : cases) {
    const Image image = draw({{{mesh.get(), Eigen::Isometry3d::Identity(), kRed}}, {}}, view, 100);
    const Eigen::Vector2d from = pixelOf(view, ends.first, 100), to = pixelOf(view, ends.second, 100);
    for (const double t : {0.0, 0.25, 0.5, 0.75, 1.0}) {
      const Eigen::Vector2d at = from + t * (to - from);
      EXPECT_GT(alphaOf(image, static_cast<int>(at.x()), static_cast<int>(at.y())), 0.5);
    }
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 100; ++x) {
        const Eigen::Vector2d p(x + 0.5, y + 0.5), along = to - from;
        const double t =
            along.squaredNorm() > 0 ? std::clamp((p - from).dot(along) / along.squaredNorm(), 0.0, 1.0) : 0;
        if ((p - from - t * along).norm() > 4.5) {
          EXPECT_EQ(alphaOf(image, x, y), 0) << x << " " << y;
        }
      }
    }
  }
}

TEST_F(Pictures, CountsThePointsThatAreSeen) {
  const auto mesh = test::box({-0.5, -0.5, -0.1}, {0.5, 0.5, 0.1}).mesh();
  View view;
  view.reach = 2;
  const Scene scene = {{{mesh.get(), Eigen::Isometry3d::Identity(), kRed}}, {}};
  const std::vector<Eigen::Vector3d> front = {{0, 0, 0.1}, {0.3, -0.4, 0.1}}, back = {{0, 0, -0.1}, {0.3, -0.4, -0.1}};
  EXPECT_EQ(renderer().countSeen(scene, view, 64, front), 2u);
  EXPECT_EQ(renderer().countSeen(scene, view, 64, back), 0u);
  view.axes = View::axesFrom(0, -1.5707963267948966, render::Up::kZ);  // from below
  EXPECT_EQ(renderer().countSeen(scene, view, 64, front), 0u);
  EXPECT_EQ(renderer().countSeen(scene, view, 64, back), 2u);
}

TEST_F(Pictures, SayWhatCannotBeDrawn) {
  EXPECT_THROW(renderer().draw({}, {}, 1 << 20, 8), OracleError);
  const Image image = renderer().draw({}, {}, 8, 4);  // and go on
  EXPECT_EQ(image.pixels, std::vector<std::uint32_t>(32, 0));
}

TEST(PictureDevice, IsTheOraclesOne) {
  const char* before = std::getenv("BOCST_ORACLE");
  const std::optional<std::string> kept = before != nullptr ? std::optional<std::string>(before) : std::nullopt;
  ::setenv("BOCST_ORACLE", "99", 1);
  try {
    Renderer renderer(OracleKind::kAuto);
    ADD_FAILURE() << "there are 100 devices?";
  } catch (const OracleError& e) {
    EXPECT_NE(std::string(e.what()).find("no picture can be drawn: there is no device 99"), std::string::npos)
        << e.what();
  }
  EXPECT_NO_THROW(Renderer{OracleKind::kCpu});
  ::setenv("BOCST_ORACLE", "0", 1);
  EXPECT_FALSE(Renderer(OracleKind::kAuto).device().empty());
  kept ? ::setenv("BOCST_ORACLE", kept->c_str(), 1) : ::unsetenv("BOCST_ORACLE");
}

/// Pixels of a picture that was made for a file.
class Pixels {
 public:
  explicit Pixels(const Picture& picture)
      : width(cairo_image_surface_get_width(picture.get())), height(cairo_image_surface_get_height(picture.get())) {
    cairo_surface_flush(picture.get());
    const auto* data = cairo_image_surface_get_data(picture.get());
    for (int y = 0; y < height; ++y) {
      const auto* row =
          reinterpret_cast<const std::uint32_t*>(data + y * cairo_image_surface_get_stride(picture.get()));
      for (int x = 0; x < width; ++x) rgb_.push_back(row[x] & 0xffffff);
    }
  }

  std::uint32_t at(int x, int y) const { return rgb_.at(static_cast<std::size_t>(y * width + x)); }

  /// Of this colour of contacts, give or take what smooth edges mix in.
  int countContact(int x0, int y0, int w, int h) const {
    int count = 0;
    for (int y = y0; y < y0 + h; ++y) {
      for (int x = x0; x < x0 + w; ++x) {
        const std::uint32_t c = at(x, y);
        count += (c >> 16 & 255) > 180 && (c >> 8 & 255) < 40 && (c & 255) < 110 ? 1 : 0;
      }
    }
    return count;
  }

  int countDark(int x0, int y0, int w, int h) const {
    int count = 0;
    for (int y = y0; y < y0 + h; ++y) {
      for (int x = x0; x < x0 + w; ++x) count += (at(x, y) & 255) < 128 ? 1 : 0;
    }
    return count;
  }

  const int width, height;

 private:
  std::vector<std::uint32_t> rgb_;
};

/// The layout of a picture of so many views.
program::Sheet layout(int width, std::size_t panels) {
  program::Sheet sheet;
  sheet.width = width;
  sheet.columns = program::columnsFor(panels);
  return sheet;
}

TEST_F(Pictures, InspectShowsTheSpheresOfEachLevel) {
  constexpr int kWidth = 700;
  const Eigen::Vector3d a(1, 2, 3);
  const std::vector<std::shared_ptr<const Mesh>> meshes = {
      test::torus(24).mesh(),
      test::torus(12).scale(1e-3).move({1e3, 0, 0}).mesh(),
      meshOf({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}),
      meshOf({a, a, a + Eigen::Vector3d::UnitX()}),
      pointAt(a),
      pointAt({0, 0, 0}),
      test::box({0, 0, 0}, {1, 2, 0}).mesh(),  // flat
  };
  for (const auto& mesh : meshes) {
    for (const Subdivision subdivision : {Subdivision::kBono, Subdivision::kOctree}) {
      Options options;
      options.depth = 4;
      options.subdivision = subdivision;
      options.oracle = OracleKind::kCpu;
      options.ttl = std::chrono::milliseconds(0);
      Modeld model(mesh, options);
      model.expandAll(options.depth);
      std::vector<NodeView> nodes;
      model.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
      int levels = 1;
      for (const NodeView& node : nodes) levels = std::max(levels, node.level);

      program::ImageArguments image;
      image.width = kWidth;
      const Pixels pixels(program::inspectPicture(renderer(), "a.off", *mesh, nodes, {}, options, image));
      ASSERT_EQ(pixels.width, kWidth);
      const program::Sheet sheet = layout(kWidth, static_cast<std::size_t>(levels) + 1);
      const View view = program::viewOf(nodes.front(), render::Up::kZ);
      const int side = sheet.side();
      for (int level = 0; level <= levels; ++level) {
        const auto [left, top] = sheet.corner(static_cast<std::size_t>(level));
        EXPECT_GT(pixels.countDark(left, top + side, side, pixels.height > top + side + 20 ? 20 : 10), 20)
            << "no label";
        // A sphere about everything leaves the corners free.
        const std::uint32_t background = pixels.at(left, top);
        EXPECT_NE(background, 0xffffffu);
        Coverage expected(side);
        addTriangles(expected, *mesh, Eigen::Isometry3d::Identity(), view);
        if (level > 0) {
          for (const NodeView& node : program::leavesAt(nodes, level))
            addDisc(expected, node.center, node.radius, view);
        }
        int shown = 0, wrong = 0;
        for (int y = 0; y < side; ++y) {
          for (int x = 0; x < side; ++x) {
            const bool drawn = pixels.at(left + x, top + y) != background;
            shown += drawn ? 1 : 0;
            // Where it is covered in part, and where strokes are wider than what they stand for, either is right.
            double least = 1, most = 0;
            for (int dy = -3; dy <= 3; ++dy) {
              for (int dx = -3; dx <= 3; ++dx) {
                const double c = expected.of(std::clamp(x + dx, 0, side - 1), std::clamp(y + dy, 0, side - 1));
                least = std::min(least, c);
                most = std::max(most, c);
              }
            }
            const bool strokes = mesh->triangleCount() == 1 || mesh->bounds().sizes().minCoeff() == 0;
            wrong += (least == 1 && !drawn) || (most == 0 && drawn && !strokes) ? 1 : 0;
          }
        }
        EXPECT_EQ(wrong, 0) << "level " << level;
        EXPECT_GT(shown, 0) << "level " << level;
      }
    }
  }
}

TEST_F(Pictures, NamesThatAreNoTextAndLongOnesAreWritten) {
  program::Sheet sheet;
  sheet.width = 200;
  sheet.panels = {{draw({}, {}, sheet.side()), std::string(300, 'w'), {}}};
  for (const std::string& title : {std::string("odd\xff\xfe.off"), std::string(2000, 'm'), std::string()}) {
    sheet.title = sheet.subtitle = title;
    sheet.legend = {{kRed, title}, {kBlue, title}};
    EXPECT_EQ(program::png(sheet.picture()).compare(1, 3, "PNG"), 0);
  }
}

TEST(Columns, LeaveFewPlacesEmpty) {
  for (std::size_t panels = 1; panels < 40; ++panels) {
    const auto columns = static_cast<std::size_t>(program::columnsFor(panels));
    ASSERT_GE(columns, 1u);
    ASSERT_LE(columns, 5u);
    EXPECT_LT((panels + columns - 1) / columns * columns - panels, columns);
  }
  EXPECT_EQ(program::columnsFor(8), 4);
  EXPECT_EQ(program::columnsFor(6), 3);
}

TEST(Marks, AreWhereContactsAre) {
  constexpr int kSide = 400;
  const Picture picture = program::whitePicture(kSide, kSide);
  const program::Pen pen = program::penOn(picture);
  std::mt19937 g(5);
  const View view = randomView(g);
  const Eigen::Vector3d to_right = view.axes.row(0).transpose(), upwards = view.axes.row(1).transpose();
  const std::vector<program::TouchingPoint> contacts = {{0.5 * to_right, upwards, 0.1},
                                                        {-0.5 * to_right, -to_right, 0}};
  const auto rightOf = [&](double right, double up) {
    return Eigen::Vector2d((1 + right / view.radius) * kSide / 2, (1 - up / view.radius) * kSide / 2);
  };
  program::markContacts(pen.get(), contacts, view, kSide, false);
  const Pixels dots(picture);
  const Eigen::Vector2d first = rightOf(0.5, 0), second = rightOf(-0.5, 0);
  for (const Eigen::Vector2d& at : {first, second}) {
    EXPECT_GT(dots.countContact(static_cast<int>(at.x()) - 2, static_cast<int>(at.y()) - 2, 5, 5), 1);
  }
  const int all_dots = dots.countContact(0, 0, kSide, kSide);
  EXPECT_LT(all_dots, 40);

  program::markContacts(pen.get(), contacts, view, kSide, true);
  const Pixels arrows(picture);
  const double length = 0.9 * program::kNormalLength * view.radius;
  for (const Eigen::Vector2d& tip : {rightOf(0.5, length), rightOf(-0.5 - length, 0)}) {
    EXPECT_GT(arrows.countContact(static_cast<int>(tip.x()) - 2, static_cast<int>(tip.y()) - 2, 5, 5), 3);
  }
  EXPECT_GT(arrows.countContact(0, 0, kSide, kSide), all_dots + 20);
  const Eigen::Vector2d against = rightOf(0.5, -0.1);
  EXPECT_EQ(arrows.countContact(static_cast<int>(against.x()) - 3, static_cast<int>(against.y()), 7, 30), 0);
}

TEST_F(Pictures, PairsShowContactsAndWhatGrew) {
  constexpr int kWidth = 900;
  const auto torus = test::torus(24).mesh();
  const auto box = test::box({-0.2, -0.2, -0.2}, {0.2, 0.2, 0.2}).mesh();
  program::ImageArguments image;
  image.width = kWidth;
  program::ModelArguments model;
  model.oracle = "cpu";
  const auto pixelsOf = [&](const Mesh& a, const Mesh& b, const std::string& pose) {
    const program::GrownPair grown("a.off", a, "b.off", b, model, program::Pose::parse(pose), program::QueryPair::kAll);
    return Pixels(program::pairPicture(renderer(), grown, image));
  };
  const auto pixelsAt = [&](const std::string& pose) { return pixelsOf(*torus, *box, pose); };
  const program::Sheet three = layout(kWidth, 3);
  const auto contactsIn = [&](const Pixels& pixels, std::size_t panel) {
    const auto [left, top] = three.corner(panel);
    return pixels.countContact(left, top, three.side(), three.side());
  };
  const Pixels touching = pixelsAt("0.7,0,0.3,1,0,0,0");
  EXPECT_GT(contactsIn(touching, 0), 20);
  EXPECT_EQ(contactsIn(touching, 1), 0);
  EXPECT_GT(contactsIn(touching, 2), contactsIn(touching, 0));
  // A vertex that no triangle has is no part of the surface, wherever it is.
  test::Raw stray = test::torus(24);
  stray.vertices.emplace_back(1000, 0, 0);
  EXPECT_EQ(contactsIn(pixelsOf(*stray.mesh(), *box, "0.7,0,0.3,1,0,0,0"), 0), contactsIn(touching, 0));
  // In the middle of the torus, near its surface but not on it: a close-up, but no contacts.
  const Pixels apart = pixelsAt("0,0,0,1,0,0,0");
  EXPECT_EQ(apart.countContact(0, 0, apart.width, apart.height), 0);
  // So far away that only the roots are looked at: two views, which are larger.
  const Pixels far = pixelsAt("9,0,0,1,0,0,0");
  EXPECT_EQ(far.countContact(0, 0, far.width, far.height), 0);
  EXPECT_GT(far.height, touching.height);
  // Neither object hides the other: A, which is bluish, would be behind a wall from the usual side.
  const auto wall = test::box({-5, -5, -0.1}, {5, 5, 0.1}).mesh();
  const Pixels behind = pixelsOf(*box, *wall, "0,0,3,1,0,0,0");
  const program::Sheet two = layout(kWidth, 2);
  const auto [left, top] = two.corner(0);
  int bluish = 0;
  for (int y = top; y < top + two.side(); ++y) {
    for (int x = left; x < left + two.side(); ++x) {
      const std::uint32_t c = behind.at(x, y);
      bluish += 100 * (c & 255) > 112 * (c >> 16 & 255) ? 1 : 0;
    }
  }
  EXPECT_GT(bluish, 50);
}

}  // namespace
}  // namespace bocst
