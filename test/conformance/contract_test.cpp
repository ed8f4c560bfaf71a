// SPDX-License-Identifier: BSD-3-Clause
// The same question gets the same contacts in the same order, whatever happened before; the integrals are FCL's; a
// child after fork() never waits for threads that stayed in the parent.
#include <bocst/bocst.h>
#include <bocst/collide_poses.h>
#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <thread>

#include "fcl/adapters/models.h"
#include "meshes.h"
#include "reference.h"
#include "sanitized.h"

namespace bocst {
namespace {

/// All that a caller sees of a contact, to the last bit.
struct Seen {
  bool first_is_o1;
  std::intptr_t b1, b2;
  double numbers[7];

  bool operator==(const Seen& other) const {
    return first_is_o1 == other.first_is_o1 && b1 == other.b1 && b2 == other.b2 &&
           std::memcmp(numbers, other.numbers, sizeof numbers) == 0;
  }
  friend std::ostream& operator<<(std::ostream& out, const Seen& s) { return out << '(' << s.b1 << ' ' << s.b2 << ')'; }
};

template <typename S>
struct Question {
  std::shared_ptr<fcl::CollisionGeometry<S>> a, b;
  fcl::Transform3<S> X, Y;

  std::vector<Seen> ask(const fcl::CollisionRequest<S>& request) const {
    fcl::CollisionResult<S> result;
    fcl::collide(a.get(), X, b.get(), Y, request, result);
    std::vector<Seen> seen;
    for (std::size_t i = 0; i < result.numContacts(); ++i) {
      const auto& c = result.getContact(i);
      Seen s{c.o1 == a.get() && c.o2 == b.get(), c.b1, c.b2, {}};
      for (int k = 0; k < 3; ++k) {
        s.numbers[k] = static_cast<double>(c.normal[k]);
        s.numbers[3 + k] = static_cast<double>(c.pos[k]);
      }
      s.numbers[6] = static_cast<double>(c.penetration_depth);
      if (!request.enable_contact) std::fill(s.numbers, s.numbers + 7, 0.0);  // any NaN
      seen.push_back(s);
    }
    return seen;
  }
};

template <typename S>
class Contacts : public ::testing::Test {
 protected:
  using Geometry = std::shared_ptr<fcl::CollisionGeometry<S>>;
  using Make = std::function<Geometry(const Options&)>;

  static Make model(const test::Raw& raw, Answer answer, double margin = 0) {
    return [mesh = raw.mesh(), answer, margin](Options options) {
      options.answer = answer;
      options.margin = margin;
      options.depth = 5;
      return std::make_shared<Model<S>>(mesh, options);
    };
  }
  static Make fixed(Geometry geometry) {
    return [geometry](const Options&) { return geometry; };
  }

  Contacts() {
    const test::Raw torus = test::torus(24), other = test::torus(17, 0.2);
    const Make exact = model(torus, Answer::kExact), spheres = model(torus, Answer::kConservative);
    const Make far = model(other, Answer::kExact, 0.02);
    pairs = {{exact, model(other, Answer::kExact)},
             {exact, exact},
             {exact, far},
             {exact, model(test::adversarial(), Answer::kExact)},
             {spheres, model(other, Answer::kConservative)},
             {spheres, model(other, Answer::kExact)},
             {model(other, Answer::kExact), spheres}};
    std::vector<Geometry> partners = {test::bvh<fcl::OBBRSS<S>>(other), std::make_shared<fcl::Box<S>>(S(1), S(1), S(1)),
                                      std::make_shared<fcl::Capsule<S>>(S(0.4), S(1))};
#if FCL_HAVE_OCTOMAP
    auto octomap = std::make_shared<octomap::OcTree>(0.2);
    for (int i = 0; i < 500; ++i) {
      const auto x = static_cast<float>(i % 10) / 5 - 1, y = static_cast<float>(i / 10 % 10) / 5 - 1;
      if (i % 3 != 0) octomap->updateNode(octomap::point3d(x, y, static_cast<float>(i / 100) / 5 - 0.5f), true);
    }
    partners.push_back(std::make_shared<fcl::OcTree<S>>(octomap));
#endif
    for (const Geometry& partner : partners) {
      pairs.push_back({exact, fixed(partner)});
      pairs.push_back({fixed(partner), exact});
      pairs.push_back({fixed(partner), spheres});
    }
    std::mt19937 g(3);
    std::normal_distribution<double> n;
    for (int i = 0; i < 4; ++i) {
      const Eigen::Matrix3d R = Eigen::Quaterniond(n(g), n(g), n(g), n(g)).normalized().toRotationMatrix();
      poses.push_back(test::pose<S>(R, Eigen::Vector3d(n(g), n(g), n(g)) / 3));
    }
    for (const std::size_t most : {2, 7, 100000}) {
      for (const bool contact : {true, false}) requests.emplace_back(most, contact);
    }
    requests.emplace_back(1, true);
    requests.emplace_back(1000, true);
  }

  static Model<S>* asModel(const Geometry& g) { return dynamic_cast<Model<S>*>(g.get()); }

  /// Few contacts are those of the least places, also of two models.
  static Options byPlace() {
    Options options;
    options.memory_budget = std::size_t{1} << 30;
    return options;
  }
  /// A pair whose few contacts may be those that a walk in order finds.
  static bool mayBeInOrder(const Question<S>& q) {
    for (const Geometry& g : {q.a, q.b}) {
      const Model<S>* m = asModel(g);
      if (m == nullptr && g->getObjectType() == fcl::OT_GEOM) return false;
      if (m != nullptr && (m->options().answer != Answer::kExact || m->options().memory_budget > 0)) return false;
    }
    return true;
  }

  /// Between which numbers a contact's place lies, by which few contacts are chosen; see `collide` in bocst/fcl.h.
  static std::pair<double, double> placeOf(const Question<S>& q, const Seen& s) {
    const Model<S>*a = asModel(q.a), *b = asModel(q.b);
    if (a != nullptr && a->options().answer == Answer::kConservative) return {s.b1, s.b1};
    if (b != nullptr && b->options().answer == Answer::kConservative) return {s.b2, s.b2};
    const bool turned = a == nullptr;
    const Mesh& mesh = turned ? *b->mesh() : *a->mesh();
    const Eigen::Vector3d extent = mesh.bounds().diagonal();
    const int axis = extent[2] > std::max(extent[0], extent[1]) ? 2 : extent[1] > extent[0] ? 1 : 0;
    const auto at = [axis](const Eigen::Vector3d& x) {
      return x[axis] + 0.31 * x[(axis + 1) % 3] + 0.23 * x[(axis + 2) % 3];
    };
    const Triangle own = triangle(mesh, turned ? s.b2 : s.b1, Eigen::Isometry3d::Identity());
    const auto endOf = [&](const Triangle& t) { return std::max({at(t[0]), at(t[1]), at(t[2])}); };
    const auto other = triangleOf(turned ? q.a : q.b, turned ? s.b1 : s.b2,
                                  (turned ? q.Y.inverse() * q.X : q.X.inverse() * q.Y).template cast<double>());
    // Where a triangle and a body have both begun: not before the triangle, and before it ends.
    if (!other.has_value()) return {std::min({at(own[0]), at(own[1]), at(own[2])}), endOf(own)};
    const double end = std::min(endOf(own), endOf(*other));
    if ((a != nullptr && a->options().margin > 0) || (b != nullptr && b->options().margin > 0)) {
      return {endOf(own), endOf(own)};
    }
    double cut = std::numeric_limits<double>::infinity();
    for (const auto& [p, t] : {std::make_pair(own, *other), std::make_pair(*other, own)}) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Eigen::Vector3d begin = p[k], way = p[(k + 1) % 3] - begin;
        Eigen::Matrix3d m;
        m << t[1] - t[0], t[2] - t[0], -way;
        const Eigen::FullPivLU<Eigen::Matrix3d> lu(m);
        if (!lu.isInvertible()) continue;
        const Eigen::Vector3d x = lu.solve(begin - t[0]);
        if (!(x.minCoeff() > -1e-9 && x[0] + x[1] < 1 + 1e-9 && x[2] < 1 + 1e-9)) continue;
        cut = std::min(cut, at(begin) + x[2] * at(way));
      }
    }
    return {std::min(cut, end), end};
  }

  using Triangle = std::array<Eigen::Vector3d, 3>;
  static Triangle triangle(const Mesh& mesh, std::intptr_t t, const Eigen::Isometry3d& X) {
    const auto& i = mesh.indices(static_cast<std::size_t>(t));
    return {X * mesh.vertex(i[0]), X * mesh.vertex(i[1]), X * mesh.vertex(i[2])};
  }
  static std::optional<Triangle> triangleOf(const Geometry& g, std::intptr_t t, const fcl::Transform3<double>& X) {
    if (const Model<S>* model = asModel(g)) return triangle(*model->mesh(), t, X);
    const auto* bvh = dynamic_cast<const fcl::BVHModel<fcl::OBBRSS<S>>*>(g.get());
    if (bvh == nullptr) return {};
    Triangle corners;
    for (int k = 0; k < 3; ++k) {
      corners[static_cast<std::size_t>(k)] =
          X * bvh->vertices[bvh->tri_indices[t][static_cast<std::size_t>(k)]].template cast<double>();
    }
    return corners;
  }

  /// The answer to a request for `most` is of `all`, in the same order; up to 1024 those of the least places.
  static void expectSomeOf(const std::vector<Seen>& all, const Question<S>& q, const std::vector<Seen>& some,
                           std::size_t most, bool by_place) {
    ASSERT_EQ(some.size(), std::min(all.size(), most));
    by_place = by_place && !mayBeInOrder(q);
    const bool by_ids = !by_place && (most > 1024 || !mayBeInOrder(q));
    double last = -std::numeric_limits<double>::infinity(), first_left_out = -last, size = 0;
    std::size_t k = 0;
    for (const Seen& s : all) {
      const bool is_in = k < some.size() && some[k] == s;
      k += is_in;
      if (by_ids) {
        ASSERT_EQ(is_in, k == static_cast<std::size_t>(&s - all.data()) + 1 && k <= most);
        continue;
      }
      if (!by_place) continue;
      const auto [low, high] = placeOf(q, s);
      if (is_in && std::isfinite(low)) last = std::max(last, low);
      if (!is_in) first_left_out = std::min(first_left_out, high);
      size = std::max(size, std::abs(high));
    }
    ASSERT_EQ(k, some.size()) << "others, or in another order";
    if (by_place) {
      EXPECT_LE(last, first_left_out + 1e-5 * size);
    }
  }

  /// Everything there is, sorted by ids; and each request gets the documented part of it.
  void expectPartsOfAll(const Question<S>& q, const std::string& what) const {
    SCOPED_TRACE(what);
    const auto all = q.ask(fcl::CollisionRequest<S>(100000, true));
    for (std::size_t i = 0; i < all.size(); ++i) {
      ASSERT_TRUE(all[i].first_is_o1);
      if (i > 0) {
        ASSERT_LT(std::make_pair(all[i - 1].b1, all[i - 1].b2), std::make_pair(all[i].b1, all[i].b2));
      }
    }
    for (const auto& request : requests) {
      auto expected = all;
      if (!request.enable_contact) {
        for (Seen& s : expected) std::fill(s.numbers, s.numbers + 7, 0.0);
      }
      expectSomeOf(expected, q, q.ask(request), request.num_max_contacts, true);
    }
    fcl::CollisionResult<S> verdict;
    fcl::collide(q.a.get(), q.X, q.b.get(), q.Y, fcl::CollisionRequest<S>(), verdict);
    ASSERT_EQ(verdict.isCollision(), !all.empty());
  }

  std::vector<std::pair<Make, Make>> pairs;
  std::vector<fcl::Transform3<S>> poses;
  std::vector<fcl::CollisionRequest<S>> requests;
};
using Scalars = ::testing::Types<float, double>;
TYPED_TEST_SUITE(Contacts, Scalars);

TYPED_TEST(Contacts, DoNotDependOnWhatHappenedBefore) {
  using S = TypeParam;
  std::vector<Options> ways(4);
  ways[1].memory_budget = 20000;
  ways[2].ttl = std::chrono::milliseconds(1);
  std::int64_t ticks = 0;
  ways[2].clock = [&ticks] { return Clock::time_point(std::chrono::milliseconds(ticks += 7)); };
  ways[3].subdivision = Subdivision::kOctree;
  std::size_t contacts = 0;
  for (std::size_t p = 0; p < this->pairs.size(); ++p) {
    const auto& [make_a, make_b] = this->pairs[p];
    const Question<S> reference{make_a({}), make_b({}), this->poses[0], this->poses[1]};
    for (const auto& request : this->requests) {
      const auto expected = reference.ask(request);
      contacts += expected.size();
      const auto cold = Question<S>{make_a({}), make_b({}), this->poses[0], this->poses[1]};
      ASSERT_EQ(cold.ask(request), expected) << "pair " << p << ", cold";
      ASSERT_EQ(cold.ask(request), expected) << "pair " << p << ", warm";
      for (const auto& geometry : {cold.a, cold.b}) {
        if (Model<S>* m = this->asModel(geometry)) m->prune(Clock::now() + std::chrono::hours(1));
      }
      ASSERT_EQ(cold.ask(request), expected) << "pair " << p << ", after prune";
      std::vector<Seen> elsewhere;
      std::thread([&] { elsewhere = cold.ask(request); }).join();
      ASSERT_EQ(elsewhere, expected) << "pair " << p << ", on another thread";
    }
    this->expectPartsOfAll(reference, "pair " + std::to_string(p));
    this->expectPartsOfAll({make_a({}), make_b({}), this->poses[1], this->poses[0]}, "turned, " + std::to_string(p));
    this->expectPartsOfAll({make_a(this->byPlace()), make_b(this->byPlace()), this->poses[1], this->poses[0]},
                           "by place, " + std::to_string(p));
    for (std::size_t w = 0; w < ways.size(); ++w) {
      Question<S> other{make_a(ways[w]), make_b(ways[w]), this->poses[2], this->poses[3]};
      other.ask(fcl::CollisionRequest<S>());
      other.ask(this->requests.back());
      if (w % 2 == 1) {
        for (const auto& geometry : {other.a, other.b}) {
          if (Model<S>* m = this->asModel(geometry)) m->expandAll(4);
        }
      }
      other.X = this->poses[0];
      other.Y = this->poses[1];
      for (const auto& request : this->requests) {
        auto expected = reference.ask(request);
        // The cells of the two subdivisions are others.
        const auto* a = this->asModel(other.a);
        const auto* b = this->asModel(other.b);
        const bool cells = (a != nullptr && a->options().answer == Answer::kConservative) ||
                           (b != nullptr && b->options().answer == Answer::kConservative);
        if (cells && w == 3) {
          this->expectPartsOfAll(other, "pair " + std::to_string(p) + ", octree");
        } else if (w % 2 == 1 && this->mayBeInOrder(reference)) {  // of another order, or by place
          const Question<S> alone{make_a(ways[w]), make_b(ways[w]), this->poses[0], this->poses[1]};
          ASSERT_EQ(other.ask(request), alone.ask(request)) << "pair " << p << ", way " << w;
        } else {
          ASSERT_EQ(other.ask(request), expected) << "pair " << p << ", way " << w;
        }
      }
    }
  }
  EXPECT_GT(contacts, 1000u);
}

TYPED_TEST(Contacts, DoNotDependOnTheOracle) {
  using S = TypeParam;
  for (const OracleInfo& oracle : availableOracles()) {
    if (!oracle.why_not.empty() || oracle.kind == OracleKind::kSampled) continue;
    Options options;
    options.oracle = oracle.kind;
    for (std::size_t p = 0; p < this->pairs.size(); p += 2) {
      const auto& [make_a, make_b] = this->pairs[p];
      Options cpu;
      cpu.oracle = OracleKind::kCpu;
      const Question<S> reference{make_a(cpu), make_b(cpu), this->poses[0], this->poses[1]};
      const Question<S> by_place{make_a(this->byPlace()), make_b(this->byPlace()), this->poses[0], this->poses[1]};
      for (const auto& request : this->requests) {
        const Question<S> q{make_a(options), make_b(options), this->poses[0], this->poses[1]};
        const bool is_in_order = this->mayBeInOrder(q) && oracle.kind == OracleKind::kCpu;
        const Question<S>& same = is_in_order ? reference : by_place;
        ASSERT_EQ(q.ask(request), same.ask(request)) << oracle.name << ", pair " << p;
      }
    }
  }
}

// More pairs than are gathered at a time.
TYPED_TEST(Contacts, AreThoseOfVeryMany) {
  using S = TypeParam;
  test::Raw fan;
  for (int i = 0; i < 400; ++i) {
    const double z = i * 1e-4;
    fan.addTriangle({-1, -1, z}, {1, -1, -z}, {0, 1, 0.01});
  }
  std::mt19937 g(9);
  std::shuffle(fan.triangles.begin(), fan.triangles.end(), g);
  const Options options = TestFixture::byPlace();
  Question<S> q{std::make_shared<Model<S>>(fan.mesh(), options), std::make_shared<Model<S>>(fan.mesh(), options),
                fcl::Transform3<S>::Identity(), test::pose<S>(Eigen::Matrix3d::Identity(), {0.01, 0.02, 0})};
  const auto all = q.ask(fcl::CollisionRequest<S>(10000000, true));
  ASSERT_GT(all.size(), std::size_t{1} << 16);
  for (const std::size_t most : {1, 2, 10, 1000, 1024, 1025, 2000, 100000}) {
    SCOPED_TRACE(most);
    this->expectSomeOf(all, q, q.ask(fcl::CollisionRequest<S>(most, true)), most, most <= 1024);
  }
}

// With costs, exact or approximate, or for more than 1024: those of the least ids, whichever side has cells.
TYPED_TEST(Contacts, AreThoseOfTheLeastIds) {
  using S = TypeParam;
  const test::Raw raw = test::torus(40);
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 5;
  const auto exact = std::make_shared<Model<S>>(raw.mesh()), cells = std::make_shared<Model<S>>(raw.mesh(), options);
  const auto I = fcl::Transform3<S>(fcl::Transform3<S>::Identity());
  const auto Y = test::pose<S>(Eigen::Matrix3d::Identity(), {-0.5, 0.2, 0.1});
  const std::shared_ptr<fcl::CollisionGeometry<S>> ball = std::make_shared<fcl::Sphere<S>>(S(1.2));
  for (const auto& [a, b] : {std::pair(exact, cells), std::pair(cells, exact), std::pair(cells, cells)}) {
    const Question<S> q{a, b, I, Y};
    const auto all = q.ask(fcl::CollisionRequest<S>(10000000, false));
    ASSERT_GT(all.size(), 2000u);
    this->expectSomeOf(all, q, q.ask(fcl::CollisionRequest<S>(10, false, 5, true, false)), 10, false);
    this->expectSomeOf(all, q, q.ask(fcl::CollisionRequest<S>(1500, false)), 1500, false);
  }
  for (const bool is_approximate : {false, true}) {
    const Question<S> q{exact, ball, I, Y};
    const auto all = q.ask(fcl::CollisionRequest<S>(10000000, false));
    ASSERT_GT(all.size(), 20u);
    for (const std::size_t most : {1, 10}) {
      this->expectSomeOf(all, q, q.ask(fcl::CollisionRequest<S>(most, false, 5, true, is_approximate)), most, false);
    }
  }
}

// In whose frame a pair is computed must not depend on where models lie in memory.
TYPED_TEST(Contacts, OfACellAndATriangleAreTheSameAtEqualPoses) {
  using S = TypeParam;
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 4;
  const auto X =
      test::pose<S>(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(), {0.3, -0.2, 5});
  const auto mesh = test::torus(20).mesh(), moved = test::torus(20).move({0.3, 0.4, 0.2}).mesh();
  std::vector<std::shared_ptr<Model<S>>> cells, exact;
  for (int i = 0; i < 6; ++i) {
    cells.push_back(std::make_shared<Model<S>>(mesh, options));
    exact.push_back(std::make_shared<Model<S>>(moved));
  }
  const fcl::CollisionRequest<S> request(10000, true);
  const auto expected = Question<S>{cells[0], exact[0], X, X}.ask(request);
  ASSERT_GT(expected.size(), 100u);
  std::array<int, 2> orders = {0, 0};
  for (const auto& a : cells) {
    for (const auto& b : exact) {
      ++orders[std::less<const tree::Tree*>()(&fcl_adapter::treeOf(*a), &fcl_adapter::treeOf(*b))];
      ASSERT_EQ((Question<S>{a, b, X, X}.ask(request)), expected);
    }
  }
  EXPECT_GT(std::min(orders[0], orders[1]), 0);
}

// Thin layers across the longest axis, in four columns, many in each leaf: where a walk is cut shows in each.
TYPED_TEST(Contacts, AreThoseOfThinLayers) {
  using S = TypeParam;
  test::Raw layers;
  std::mt19937 g(10);
  std::uniform_real_distribution<double> u(0, 3);
  for (int i = 0; i < 3000; ++i) {
    const double x = u(g), y = g() % 2 ? 0.5 : -0.5, z = g() % 2 ? 0.5 : -0.5;
    layers.addTriangle({x, y - 0.4, z - 0.4}, {x, y + 0.4, z - 0.4}, {x, y, z + 0.4});
  }
  const test::Raw rod = test::box({0.5, -0.5, -0.5}, {2.5, 0.5, 0.5});
  // As small as the distance of some layers along the axis, and as large across it: no node has far larger triangles.
  test::Raw chips;
  for (int i = 0; i < 3000; ++i) {
    const double x = u(g), y = g() % 2 ? 0.5 : -0.5, z = 0.5 * (u(g) - 1.5);
    chips.addTriangle({x, y - 0.4, z}, {x + 0.01, y + 0.4, z}, {x, y, z + 0.1});
  }
  const Options options = TestFixture::byPlace();
  const auto a = std::make_shared<Model<S>>(layers.mesh(), options);
  const auto c = std::make_shared<Model<S>>(rod.mesh(), options);
  const auto X = fcl::Transform3<S>::Identity();
  const auto Y = test::pose<S>(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitZ()).toRotationMatrix(), {0, 0, 0});
  using G = typename TestFixture::Geometry;
  const auto d = std::make_shared<Model<S>>(chips.mesh(), options);
  const std::vector<std::pair<G, G>> rows = {{a, c},
                                             {a, test::bvh<fcl::OBBRSS<S>>(rod)},
                                             {a, std::make_shared<fcl::Box<S>>(S(4), S(1), S(1))},
                                             {c, a},
                                             {c, test::bvh<fcl::OBBRSS<S>>(layers)},
                                             {d, a},
                                             {d, test::bvh<fcl::OBBRSS<S>>(layers)}};
  for (const auto& [first, second] : rows) {
    for (const bool swapped : {false, true}) {
      const Question<S> q = swapped ? Question<S>{second, first, Y, X} : Question<S>{first, second, X, Y};
      const auto all = q.ask(fcl::CollisionRequest<S>(100000, true));
      ASSERT_GT(all.size(), 1500u);
      for (std::size_t most = 2; most < 1000; most += 37) {
        SCOPED_TRACE(most);
        this->expectSomeOf(all, q, q.ask(fcl::CollisionRequest<S>(most, true)), most, true);
      }
    }
  }
}

TYPED_TEST(Contacts, AccumulateInOrder) {
  using S = TypeParam;
  const auto& [make_a, make_b] = this->pairs[0];
  const Question<S> q{make_a({}), make_b({}), this->poses[0], this->poses[1]};
  const auto three = q.ask(fcl::CollisionRequest<S>(3, true)), two = q.ask(fcl::CollisionRequest<S>(2, true));
  ASSERT_EQ(three.size() + two.size(), 5u);
  fcl::CollisionResult<S> result;
  fcl::collide(q.a.get(), q.X, q.b.get(), q.Y, fcl::CollisionRequest<S>(3, true), result);
  fcl::collide(q.a.get(), q.X, q.b.get(), q.Y, fcl::CollisionRequest<S>(5, true), result);
  ASSERT_EQ(result.numContacts(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    const Seen& expected = i < 3 ? three[i] : two[i - 3];
    EXPECT_EQ(result.getContact(i).b1, expected.b1);
    EXPECT_EQ(result.getContact(i).b2, expected.b2);
  }
}

TYPED_TEST(Contacts, IntegralsAreThoseOfFcl) {
  using S = TypeParam;
  test::Raw open = test::torus(13), turned = test::box({1, 2, 3}, {4, 4, 4});
  open.triangles.resize(open.triangles.size() / 2);
  for (auto& t : turned.triangles) std::swap(t[0], t[1]);
  test::Raw far = test::torus(20);
  far.move({10, -7, 3});
  for (const test::Raw& raw : {test::box({0, 0, 0}, {1, 2, 3}), test::torus(20), open, turned, far}) {
    const Model<S> model(raw.mesh());
    const auto bvh = test::bvh<fcl::OBBRSS<S>>(raw);
    const double size = raw.mesh()->bounds().diagonal().norm() + raw.mesh()->bounds().center().norm();
    const double error = 100 * static_cast<double>(std::numeric_limits<S>::epsilon()) * std::pow(size, 3);
    EXPECT_NEAR(model.computeVolume(), bvh->computeVolume(), error);
    EXPECT_NE(model.computeVolume(), S(0));
    EXPECT_LT((model.computeCOM() - bvh->computeCOM()).norm(), error * size / std::abs(bvh->computeVolume()));
    EXPECT_LT((model.computeMomentofInertia() - bvh->computeMomentofInertia()).norm(), error * size * size);
    EXPECT_LT((model.computeMomentofInertiaRelatedToCOM() - bvh->computeMomentofInertiaRelatedToCOM()).norm(),
              10 * error * size * size);
  }
  const Model<S> unit(test::box({0, 0, 0}, {1, 1, 1}).mesh());
  EXPECT_NEAR(unit.computeVolume(), 1, 1e-6);
  EXPECT_LT((unit.computeCOM() - fcl::Vector3<S>::Constant(S(0.5))).norm(), 1e-6);
  EXPECT_NEAR(unit.computeMomentofInertia()(0, 0), 2.0 / 3, 1e-6);
  EXPECT_NEAR(unit.computeMomentofInertia()(0, 1), -0.25, 1e-6);
}

/// Runs f in a child, which has so many seconds. 0: f returned true.
int inChild(const std::function<bool()>& f) {
  const pid_t child = fork();
  if (child == 0) {
    alarm(30);  // a child that hangs is killed by it
    bool right = false;
    try {
      right = f();
    } catch (const std::exception& e) {
      std::fprintf(stderr, "in the child: %s\n", e.what());
    }
    _exit(right ? 0 : 1);
  }
  int status = -1;
  waitpid(child, &status, 0);
  return status;
}

using ModelPtr = std::shared_ptr<Modeld>;

bool touches(const ModelPtr& a, const ModelPtr& b, double x) {
  fcl::Transform3d X = fcl::Transform3d::Identity();
  X.translation()[0] = x;
  return test::touching<double>(*a, fcl::Transform3d::Identity(), *b, X);
}

ModelPtr cpuModel(const std::shared_ptr<const Mesh>& mesh) {
  Options options;
  options.oracle = OracleKind::kCpu;
  return std::make_shared<Modeld>(mesh, options);
}

TEST(Fork, AChildUsesModelsOfAQuietParent) {
  const auto mesh = test::torus(30).mesh();
  const ModelPtr a = cpuModel(mesh), b = cpuModel(mesh);
  EXPECT_TRUE(touches(a, b, 0.1));
  EXPECT_EQ(inChild([&] {
              const bool right = touches(a, b, 0.2) && !touches(a, b, 4);
              a->prune(Clock::now() + std::chrono::hours(1));
              b->expandAll(4);
              b->updateVertices(mesh->vertices());
              // And a child of the child.
              return right && touches(a, b, 0.3) && inChild([&] { return touches(a, b, 0.3); }) == 0;
            }),
            0);
  EXPECT_TRUE(touches(a, b, 0.3));
}

/// Asks all kinds of queries of two models of its own.
struct Asker {
  Modeld a{test::torus(30).mesh()}, b{test::torus(12).mesh()};

  bool ask() const {
    const fcl::Transform3d I = fcl::Transform3d::Identity(), far(Eigen::Translation3d(4, 0, 0)),
                           turned(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitX()));
    fcl::CollisionResultd result;
    const bool touch = fcl::collide(&a, I, &b, turned, fcl::CollisionRequestd(10, true), result) > 0 &&
                       test::touching<double>(a, I, b, turned) && !test::touching<double>(a, I, b, far);
    fcl::DistanceResultd distance;
    const bool apart = fcl::distance(&a, I, &b, far, fcl::DistanceRequestd(true), distance) > 1;
    const fcl::Transform3d poses[] = {turned, far};
    std::uint8_t hits[2];
    collidePoses(a, b, poses, 2, hits, 1);
    const fcl::Boxd box(1, 1, 1);
    fcl::CollisionResultd with_box;
    fcl::ContinuousCollisionResultd on_way;
    fcl::continuousCollide(&a, I, I, &b, far, turned, fcl::ContinuousCollisionRequestd(), on_way);
    return touch && apart && hits[0] == 1 && hits[1] == 0 && on_way.is_collide &&
           fcl::collide(&a, I, &box, I, fcl::CollisionRequestd(10, true), with_box) > 0;
  }
};

// Objects with static storage are destroyed after the thread_local ones of the main thread.
TEST(Ends, HandlersAtExitMayQuery) {
  static const Asker* asker = nullptr;
  EXPECT_EQ(inChild([] {
              asker = new Asker;
              if (!asker->ask()) return false;
              std::atexit([] {
                // Twice: the first query makes the memory that the second uses.
                const bool right = asker->ask() && asker->ask();
                delete asker;
                _exit(right ? 0 : 1);
              });
              std::exit(1);
            }),
            0);
}

// What a thread destroys last, it has made first.
TEST(Ends, ThreadLocalObjectsMayQueryWhenTheyAreDestroyed) {
  static std::atomic<int> right{0};
  struct Last {
    std::unique_ptr<const Asker> asker = std::make_unique<const Asker>();
    ~Last() { right += asker->ask() && asker->ask(); }
  };
  for (int t = 0; t < 3; ++t) {
    std::thread([] {
      thread_local const Last last;
      EXPECT_TRUE(last.asker->ask());
    }).join();
  }
  EXPECT_EQ(right, 3);
}

// Threads query, grow, prune and deform; at any moment a child begins.
TEST(Fork, AChildOfABusyParentNeverHangs) {
  if (test::kSanitized) GTEST_SKIP() << "a sanitizer's allocator that is locked where a child begins stays locked";
  const auto mesh = test::torus(40).mesh();
  const ModelPtr a = cpuModel(mesh), b = cpuModel(mesh);
  std::atomic<bool> stop{false};
  std::vector<std::thread> threads;
  for (int t = 0; t < 3; ++t) {
    threads.emplace_back([&, t] {
      std::mt19937 g(static_cast<unsigned>(t));
      std::uniform_real_distribution<double> u(0, 2);
      while (!stop) touches(a, b, u(g));
    });
  }
  threads.emplace_back([&] {
    while (!stop) {
      a->prune(Clock::now() + std::chrono::hours(1));
      b->updateVertices(mesh->vertices());
    }
  });
  int answered = 0, refused = 0;
  for (int round = 0; round < 40; ++round) {
    std::this_thread::sleep_for(std::chrono::microseconds(300 * round));
    // Models of its own always serve.
    EXPECT_EQ(inChild([&] {
                const ModelPtr own = cpuModel(mesh), other = cpuModel(test::torus(20).mesh());
                return touches(own, other, 0.1) && !touches(own, other, 4);
              }),
              0);
    // The parent's answer rightly or refuse, and so does all else that waits for locks.
    const int status = inChild([&] {
      int said_no = 0;
      const auto attempt = [&](const std::function<bool()>& f) {
        try {
          return f();
        } catch (const std::runtime_error& e) {
          ++said_no;
          return std::string(e.what()).find("fork") != std::string::npos;
        }
      };
      const bool right = attempt([&] { return touches(a, b, 0.1); }) && attempt([&] { return !touches(a, b, 4); }) &&
                         attempt([&] { return a->statistics().resident_nodes > 0; }) &&
                         attempt([&] { return a->prune(), true; }) &&
                         attempt([&] { return b->updateVertices(mesh->vertices()), true; }) &&
                         attempt([&] { return touches(b, a, 0.1); });
      if (right && said_no > 0) _exit(7);
      return right;
    });
    EXPECT_TRUE(WIFEXITED(status)) << "killed by signal " << WTERMSIG(status) << " in round " << round;
    if (!WIFEXITED(status)) break;
    EXPECT_TRUE(WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == 7) << WEXITSTATUS(status);
    (WEXITSTATUS(status) == 0 ? answered : refused)++;
  }
  stop = true;
  for (std::thread& t : threads) t.join();
  EXPECT_GT(refused, 0) << "no child began while the models were in use: " << answered << " answered";
}

}  // namespace
}  // namespace bocst
