// SPDX-License-Identifier: BSD-3-Clause
#pragma once

// The whole matrix of a Model and what it may meet: each partner in both orders, with both solvers, in S. What is right
// comes from all pairs of triangles and convex pieces, one by one (convex.h); where FCL's own mesh is right, it must
// agree.

#include <gtest/gtest.h>

#include <map>
#include <string>

#include "conformance/reference.h"
#include "conformance/solids.h"

namespace bocst::test {

/// One row of the matrix.
template <typename S>
struct Partner {
  std::shared_ptr<fcl::CollisionGeometry<S>> geometry;
  Solids solids;
  /// What FCL is asked instead; null where FCL has no answer.
  std::shared_ptr<fcl::CollisionGeometry<S>> fcl;
  /// Triangles of its own: then it is FCL's triangle test that decides, and pairs are FCL's exactly.
  bool is_mesh = false;
};

/// A mesh that is the same in float.
inline Raw inFloat(Raw raw) {
  for (auto& v : raw.vertices) v = v.cast<float>().cast<double>();
  return raw;
}

inline Raw modelMesh() { return inFloat(torus(8)); }
inline Raw partnerMesh() { return inFloat(torus(6, 0.2).scale(0.8)); }

template <typename S>
Partner<S> octreePartner(double resolution) {
  auto map = std::make_shared<octomap::OcTree>(resolution);
  std::mt19937_64 g(5);
  for (int i = 0; i < 90; ++i) {
    const Eigen::Vector3f p = (randomDirection(g) * 0.5).cast<float>();
    map->updateNode(octomap::point3d(p.x(), p.y(), p.z()), i % 4 > 0);  // one in four is free
  }
  map->updateInnerOccupancy();
  const auto octree = std::make_shared<fcl::OcTree<S>>(map);
  return {octree, solidsOf(*octree, *map), octree, false};
}

template <typename S>
std::shared_ptr<fcl::Convex<S>> convexOf(const Raw& raw) {
  auto vertices = std::make_shared<std::vector<fcl::Vector3<S>>>();
  auto faces = std::make_shared<std::vector<int>>();
  for (const auto& v : raw.vertices) vertices->push_back(v.cast<S>());
  for (const auto& t : raw.triangles) {
    faces->insert(faces->end(), {3, static_cast<int>(t[0]), static_cast<int>(t[1]), static_cast<int>(t[2])});
  }
  return std::make_shared<fcl::Convex<S>>(vertices, static_cast<int>(raw.triangles.size()), faces);
}

template <typename S, typename BV>
Partner<S> bvhPartner() {
  const Raw raw = partnerMesh();
  return {bvh<BV>(raw), solidsOf(raw), bvh<fcl::OBBRSS<S>>(raw), true};
}

template <typename S>
Partner<S> modelPartner() {
  const Raw raw = partnerMesh();
  return {std::make_shared<Model<S>>(raw.mesh()), solidsOf(raw), bvh<fcl::OBBRSS<S>>(raw), true};
}

template <typename S>
Partner<S> shapePartner(const std::string& name) {
  std::shared_ptr<fcl::ShapeBase<S>> shape;
  if (name == "convex of a mesh") shape = convexOf<S>(inFloat(box({-0.4, -0.3, -0.5}, {0.4, 0.3, 0.5})));
  for (const auto& s : shapes<S>()) {
    if (s.name == name) shape = s.shape;
  }
  shape->computeLocalAABB();
  return {shape, {solidOf<S>(*shape)}, name == "triangle" ? nullptr : shape, false};
}

/// The rows. FCL has no pair of its own for TriangleP.
template <typename S>
Partner<S> partner(const std::string& name) {
  if (name == "BVH of AABB") return bvhPartner<S, fcl::AABB<S>>();
  if (name == "BVH of OBB") return bvhPartner<S, fcl::OBB<S>>();
  if (name == "BVH of RSS") return bvhPartner<S, fcl::RSS<S>>();
  if (name == "BVH of kIOS") return bvhPartner<S, fcl::kIOS<S>>();
  if (name == "BVH of OBBRSS") return bvhPartner<S, fcl::OBBRSS<S>>();
  if (name == "BVH of KDOP16") return bvhPartner<S, fcl::KDOP<S, 16>>();
  if (name == "BVH of KDOP18") return bvhPartner<S, fcl::KDOP<S, 18>>();
  if (name == "BVH of KDOP24") return bvhPartner<S, fcl::KDOP<S, 24>>();
  if (name == "octree") return octreePartner<S>(0.125);
  // Its cells' corners are rounded, by FCL level by level.
  if (name == "octree of decimetres") return octreePartner<S>(0.1);
  if (name == "model") return modelPartner<S>();
  return shapePartner<S>(name);
}
const char* const kShapes[] = {"box",    "sphere",       "ellipsoid",        "capsule", "cone",       "cylinder",
                               "convex", "large convex", "convex of a mesh", "plane",   "half-space", "triangle"};
const char* const kUnions[] = {"BVH of AABB",   "BVH of OBB",           "BVH of RSS",    "BVH of kIOS",
                               "BVH of OBBRSS", "BVH of KDOP16",        "BVH of KDOP18", "BVH of KDOP24",
                               "octree",        "octree of decimetres", "model"};

inline std::string testName(const testing::TestParamInfo<const char*>& info) {
  std::string name = info.param;
  for (char& c : name) c = c == ' ' || c == '-' ? '_' : c;
  return name;
}

/// Model and partner at poses, and how far they are from the origin.
template <typename S>
struct Situation {
  fcl::Transform3<S> X, Y;
  double away;

  Eigen::Isometry3d modelInPartner() const { return inverse(Y) * Eigen::Isometry3d(X.template cast<double>()); }

 private:
  static Eigen::Isometry3d inverse(const fcl::Transform3<S>& X) {
    // In S, a rotation is one up to rounding only.
    return Eigen::Isometry3d(Eigen::Affine3d(X.template cast<double>().matrix()).inverse(Eigen::Affine).matrix());
  }
};

/// Anywhere, about contact, at contact, deep, on a raster, and far from the origin.
template <typename S>
std::vector<Situation<S>> situations(const Solids& model, const Solids& partner, int count) {
  const double far = std::is_same<S, double>::value ? 1e4 : 30;
  std::vector<Situation<S>> all;
  std::mt19937_64 g(11);
  std::uniform_real_distribution<double> u(0, 1);
  for (int i = 0; i < count; ++i) {
    const int kind = i % 8;
    Situation<S> s;
    s.away = kind == 5 || kind == 6 ? far : 1;
    const Eigen::Vector3d p = randomDirection(g) * s.away, displacement = randomDirection(g);
    const Eigen::Matrix3d R = randomRotation(g);
    s.X = pose<S>(randomRotation(g), p);
    const auto at = [&](double d) {
      s.Y = pose<S>(R, p + displacement * d);
      return s;
    };
    if (kind == 4) {
      const auto raster = [&] { return std::round(8 * (u(g) - 0.5)) / 4; };
      s.X = pose<S>(Eigen::Matrix3d::Identity(), {0, 0, 0});
      s.Y = pose<S>(Eigen::Matrix3d::Identity(), {raster(), raster(), raster()});
    } else if (kind == 0 || kind == 6) {
      at((kind == 0 ? 0 : 1.5) + 2 * u(g));
    } else if (kind == 3) {
      at(0.4 * u(g));
    } else {
      const double d = contactDistance([&](double x) { return meet(model, at(x).modelInPartner(), partner); }, 4, 40);
      at(d + (kind == 7 ? 0 : kind == 2 ? -1 : 1) * std::pow(10.0, -1 - 7 * u(g)));
    }
    all.push_back(s);
  }
  return all;
}

/// What rounding of poses in S is worth.
template <typename S>
double roundingOf(double away) {
  return 64 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (away + 3);
}

/// What FCL's solvers, and rounding in S, may be off by.
template <typename S>
double toleranceOf(double away) {
  return 2e-6 + roundingOf<S>(away);
}

/// Do the two still meet wherever the one is pushed by a little?
inline bool meetSurely(const Solid& a, const Eigen::Isometry3d& X_BA, const Solid& b, double little) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1, 1}) {
      Eigen::Isometry3d pushed = X_BA;
      pushed.translation()[axis] += sign * little;
      if (!distanceOf(a, pushed, b).meets()) return false;
    }
  }
  return true;
}

/// The pair of ids of model and partner, whatever the order.
template <typename S>
std::pair<std::intptr_t, std::intptr_t> idsOf(const fcl::Contact<S>& c, bool turned) {
  return turned ? std::make_pair(c.b2, c.b1) : std::make_pair(c.b1, c.b2);
}

/// A model and a partner, asked in either order: (partner, model) when turned.
template <typename S>
struct Pairing {
  const Model<S>& model;
  const fcl::CollisionGeometry<S>& partner;

  const fcl::CollisionGeometry<S>& first(bool turned) const {
    return turned ? partner : static_cast<const fcl::CollisionGeometry<S>&>(model);
  }
  const fcl::CollisionGeometry<S>& second(bool turned) const { return first(!turned); }

  fcl::CollisionResult<S> collide(const Situation<S>& s, bool turned, fcl::GJKSolverType solver, std::size_t most,
                                  bool contacts) const {
    fcl::CollisionRequest<S> request(most, contacts);
    request.gjk_solver_type = solver;
    fcl::CollisionResult<S> result;
    const std::size_t n =
        fcl::collide(&first(turned), turned ? s.Y : s.X, &second(turned), turned ? s.X : s.Y, request, result);
    EXPECT_EQ(n, result.numContacts());
    return result;
  }
  /// The verdict by a solver that the caller brings.
  template <typename Solver>
  bool touches(const Situation<S>& s, bool turned, const Solver& solver) const {
    fcl::CollisionResult<S> result;
    return fcl::collide(&first(turned), turned ? s.Y : s.X, &second(turned), turned ? s.X : s.Y, &solver,
                        fcl::CollisionRequest<S>(), result) > 0;
  }
  fcl::DistanceResult<S> distance(const Situation<S>& s, bool turned, fcl::GJKSolverType solver,
                                  bool is_signed = false) const {
    fcl::DistanceRequest<S> request(true, is_signed);
    request.gjk_solver_type = solver;
    fcl::DistanceResult<S> result;
    const S d = fcl::distance(&first(turned), turned ? s.Y : s.X, &second(turned), turned ? s.X : s.Y, request, result);
    EXPECT_EQ(d, result.min_distance);
    return result;
  }
};

constexpr std::size_t kAll = 1000000;

/// The pairs that FCL finds for its own mesh; it keeps the lower half of the names of cells only.
template <typename S>
Pairs pairsOfFcl(const fcl::BVHModel<fcl::OBBRSS<S>>& mesh, const fcl::CollisionGeometry<S>& partner,
                 const Situation<S>& s, bool turned) {
  fcl::CollisionResult<S> result;
  const fcl::CollisionGeometry<S>*a = &mesh, *b = &partner;
  fcl::collide(turned ? b : a, turned ? s.Y : s.X, turned ? a : b, turned ? s.X : s.Y, fcl::CollisionRequest<S>(kAll),
               result);
  Pairs pairs;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    const auto ids = idsOf(result.getContact(i), result.getContact(i).o1 != &mesh);
    pairs.insert({ids.first, static_cast<int>(ids.second)});
  }
  return pairs;
}

/// Is the contact in the order of the call, about pieces that are there, and does it part the two?
template <typename S>
void checkContact(const Pairing<S>& pairing, const Situation<S>& s, bool turned, const fcl::Contact<S>& c,
                  const std::map<std::intptr_t, const Solid*>& model,
                  const std::map<std::intptr_t, const Solid*>& partner) {
  ASSERT_EQ(c.o1, &pairing.first(turned));
  ASSERT_EQ(c.o2, &pairing.second(turned));
  ASSERT_NEAR(c.normal.norm(), 1, 1e-5);
  ASSERT_GE(c.penetration_depth, 0);
  const auto ids = idsOf(c, turned);
  ASSERT_TRUE(model.count(ids.first) && partner.count(ids.second)) << ids.first << ' ' << ids.second;
  const Solid &a = *model.at(ids.first), &b = *partner.at(ids.second);
  const double off = 20 * toleranceOf<S>(s.away);
  // The second moved along the normal, or the model the other way if it is the first.
  const double depth = static_cast<double>(c.penetration_depth);
  const Eigen::Vector3d moved = (turned ? 1 : -1) * (depth * 1.001 + off) * c.normal.template cast<double>();
  Eigen::Isometry3d X = s.modelInPartner();
  X.translation() += s.Y.template cast<double>().linear().transpose() * moved;
  ASSERT_FALSE(distanceOf(a, X, b).meets()) << "depth " << depth;
  const Solid point = sweptHullOf({c.pos.template cast<double>()});
  ASSERT_LE(distanceOf(point, Eigen::Isometry3d(s.X.template cast<double>().matrix()).inverse(), a).low, depth + off);
  ASSERT_LE(distanceOf(point, Eigen::Isometry3d(s.Y.template cast<double>().matrix()).inverse(), b).low, depth + off);
}

inline std::map<std::intptr_t, const Solid*> byId(const Solids& solids) {
  std::map<std::intptr_t, const Solid*> all;
  for (const Solid& s : solids) all[s.id] = &s;
  return all;
}

/// Are the contacts of (partner, model) those of (model, partner), seen from the other side?
template <typename S>
void checkMirrored(const fcl::CollisionResult<S>& direct, const fcl::CollisionResult<S>& turned) {
  std::map<std::pair<std::intptr_t, std::intptr_t>, fcl::Contact<S>> others;
  for (std::size_t k = 0; k < turned.numContacts(); ++k)
    others[idsOf(turned.getContact(k), true)] = turned.getContact(k);
  for (std::size_t k = 0; k < direct.numContacts(); ++k) {
    const auto& c = direct.getContact(k);
    const auto& other = others.at(idsOf(c, false));
    ASSERT_EQ(c.normal, -other.normal);
    ASSERT_EQ(c.pos, other.pos);
    ASSERT_EQ(c.penetration_depth, other.penetration_depth);
  }
}

/// collide() with exact answers.
template <typename S>
void checkCollide(const Partner<S>& row) {
  const Raw raw = modelMesh();
  const Solids solids = solidsOf(raw);
  const auto model_components = byId(solids), partner_components = byId(row.solids);
  const Model<S> model(raw.mesh());
  const auto theirs = bvh<fcl::OBBRSS<S>>(raw);
  const Pairing<S> pairing{model, *row.geometry};
  int hits = 0, misses = 0;
  const int count = 48;
  int i = -1;
  for (const auto& s : situations<S>(solids, row.solids, count)) {
    SCOPED_TRACE("situation " + std::to_string(++i));
    const double tolerance = toleranceOf<S>(s.away);
    const Eigen::Isometry3d X = s.modelInPartner();
    for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
      Pairs found[2];
      fcl::CollisionResult<S> all[2];
      for (const bool turned : {false, true}) {
        auto& result = all[turned];
        result = pairing.collide(s, turned, solver, kAll, true);
        for (std::size_t k = 0; k < result.numContacts(); ++k) {
          found[turned].insert(idsOf(result.getContact(k), turned));
          ASSERT_NO_FATAL_FAILURE(
              checkContact(pairing, s, turned, result.getContact(k), model_components, partner_components));
        }
        ASSERT_EQ(found[turned].size(), result.numContacts()) << "a pair twice";
        const auto once = pairing.collide(s, turned, solver, 1, false);
        ASSERT_EQ(once.numContacts(), found[turned].empty() ? 0u : 1u);
        if (once.isCollision()) {
          ASSERT_TRUE(found[turned].count(idsOf(once.getContact(0), turned)));
          ASSERT_TRUE(std::isnan(once.getContact(0).penetration_depth));
        }
      }
      // In S, FCL's triangle test may tell the orders apart where it cannot tell more.
      if (!row.is_mesh) {
        ASSERT_EQ(found[0], found[1]) << "the order matters";
        ASSERT_NO_FATAL_FAILURE(checkMirrored(all[0], all[1]));
      }
      (found[0].empty() ? misses : hits)++;

      bool touch = false, near = false;
      for (const Couple& c : couples(solids, X, row.solids, tolerance)) {
        const Solid &a = solids[c.a], &b = row.solids[c.b];
        const Interval d = distanceOf(a, X, b);
        near |= d.low <= tolerance;
        // Of meshes FCL's test in S decides; of others what rounding leaves open.
        const bool surely = d.meets() && meetSurely(a, X, b, row.is_mesh ? tolerance : 1e-13 + roundingOf<S>(s.away));
        touch |= surely;
        for (const Pairs& pairs : found) {
          if (pairs.count({a.id, b.id})) {
            ASSERT_LE(d.low, tolerance) << a.id << ' ' << b.id;
          } else {
            ASSERT_FALSE(surely) << a.id << ' ' << b.id << " is missed";
          }
        }
      }
      for (const bool turned : {false, true}) {
        // A solver that the caller brings has a tolerance of its own.
        const bool hit = solver == fcl::GST_LIBCCD ? pairing.touches(s, turned, fcl::detail::GJKSolver_libccd<S>())
                                                   : pairing.touches(s, turned, fcl::detail::GJKSolver_indep<S>());
        if (touch || !near || row.is_mesh) {
          ASSERT_EQ(hit, !found[turned].empty());
        }
        if (row.fcl == nullptr || solver != fcl::GST_LIBCCD) continue;
        Pairs ours;
        for (const auto& ids : found[turned]) ours.insert({ids.first, static_cast<int>(ids.second)});
        const Pairs fcls = pairsOfFcl<S>(*theirs, *row.fcl, s, turned);
        if (row.is_mesh) {
          ASSERT_EQ(ours, fcls);
        } else {
          for (const auto& ids : fcls) ASSERT_TRUE(ours.count(ids)) << ids.first << " is missed, and FCL sees it";
        }
      }
    }
  }
  EXPECT_GT(hits, 2 * count / 5) << "of " << 2 * count;
  EXPECT_GT(misses, 2 * count / 5) << "of " << 2 * count;
}

/// At the very edge of what FCL calls a contact, as far as S can tell: what FCL sees there is seen.
template <typename S>
void checkEdge(const Partner<S>& row) {
  auto reference = row.fcl;
  if (const auto* t = dynamic_cast<const fcl::TriangleP<S>*>(row.geometry.get())) {
    // FCL has a test of two triangles, if not of TriangleP.
    Raw one;
    for (const auto& v : {t->a, t->b, t->c}) one.vertices.push_back(v.template cast<double>());
    one.triangles.emplace_back(0, 1, 2);
    reference = bvh<fcl::OBBRSS<S>>(one);
  }
  const Raw raw = modelMesh();
  const Model<S> model(raw.mesh());
  const auto theirs = bvh<fcl::OBBRSS<S>>(raw);
  std::mt19937_64 g(13);
  int edges = 0;
  for (int i = 0; i < 40; ++i) {
    SCOPED_TRACE(i);
    const Eigen::Vector3d p = randomDirection(g), displacement = randomDirection(g);
    const Eigen::Matrix3d R = randomRotation(g);
    Situation<S> s;
    s.X = pose<S>(randomRotation(g), p);
    const auto sees = [&](double d, const fcl::CollisionGeometry<S>& mesh, const fcl::CollisionGeometry<S>& partner) {
      return touching<S>(mesh, s.X, partner, pose<S>(R, p + displacement * d));
    };
    double lo = 0, hi = 4;
    if (sees(hi, *theirs, *reference)) continue;
    for (int step = 0; step < 56; ++step) (sees((lo + hi) / 2, *theirs, *reference) ? lo : hi) = (lo + hi) / 2;
    lo -= kAtContact;
    if (!sees(lo, *theirs, *reference)) continue;
    s.Y = pose<S>(R, p + displacement * lo);
    ASSERT_TRUE(touching<S>(model, s.X, *row.geometry, s.Y)) << lo;
    // Of meshes, FCL's test may tell the orders apart.
    ASSERT_TRUE(row.is_mesh || touching<S>(*row.geometry, s.Y, model, s.X)) << lo;
    ++edges;
  }
  EXPECT_GT(edges, 10);
}

/// distance() with exact answers.
template <typename S>
void checkDistance(const Partner<S>& row) {
  const Raw raw = modelMesh();
  const Solids solids = solidsOf(raw);
  const auto model_components = byId(solids), partner_components = byId(row.solids);
  const Model<S> model(raw.mesh());
  const Pairing<S> pairing{model, *row.geometry};
  int apart = 0, touching = 0;
  const int count = 48;
  int i = -1;
  for (const auto& s : situations<S>(solids, row.solids, count)) {
    SCOPED_TRACE("situation " + std::to_string(++i));
    const Interval expected = distanceOf(solids, s.modelInPartner(), row.solids);
    const double off = 2e-9 + roundingOf<S>(s.away);
    ASSERT_LT(expected.high - expected.low, 1e-6) << "the reference itself";
    (expected.low > 0 ? apart : touching)++;
    for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
      for (const bool turned : {false, true}) {
        const auto d = pairing.distance(s, turned, solver);
        const double value = static_cast<double>(d.min_distance);
        ASSERT_GE(value, expected.low - off);
        ASSERT_LE(value, expected.high + off);
        ASSERT_EQ(d.o1, &pairing.first(turned));
        ASSERT_EQ(d.o2, &pairing.second(turned));
        const Eigen::Vector3d p = d.nearest_points[turned ? 1 : 0].template cast<double>();
        const Eigen::Vector3d q = d.nearest_points[turned ? 0 : 1].template cast<double>();
        ASSERT_NEAR((p - q).norm(), value, 4 * off);
        const auto a = model_components.find(turned ? d.b2 : d.b1), b = partner_components.find(turned ? d.b1 : d.b2);
        ASSERT_TRUE(a != model_components.end() && b != partner_components.end()) << d.b1 << ' ' << d.b2;
        const auto inFrame = [](const fcl::Transform3<S>& X) {
          return Eigen::Isometry3d(Eigen::Isometry3d(X.template cast<double>().matrix()).inverse());
        };
        // Where curved bodies just touch, the point is not as sharp as the distance.
        const double on = value <= off ? std::max(10 * off, 1e-4) : 10 * off;
        ASSERT_LE(distanceOf(sweptHullOf({p}), inFrame(s.X), *a->second).low, on) << "on the triangle";
        ASSERT_LE(distanceOf(sweptHullOf({q}), inFrame(s.Y), *b->second).low, on) << "on the partner";
        if (expected.low < 0.01) continue;
        // Moved nearly as far, they are nearly there; and a little farther, they touch.
        Situation<S> near = s, there = s;
        near.Y.translation() += ((p - q) * (1 - 1e-3)).template cast<S>();
        there.Y.translation() += ((p - q) * (1 + (toleranceOf<S>(s.away) + 4 * off) / value)).template cast<S>();
        ASSERT_NEAR(static_cast<double>(pairing.distance(near, turned, solver).min_distance), 1e-3 * value, 10 * off);
        if (1e-3 * value > 2 * toleranceOf<S>(s.away)) {
          ASSERT_FALSE(pairing.collide(near, turned, solver, 1, false).isCollision());
        }
        ASSERT_TRUE(pairing.collide(there, turned, solver, 1, false).isCollision());
      }
    }
    const double with_sign = static_cast<double>(pairing.distance(s, i % 2, fcl::GST_LIBCCD, true).min_distance);
    // What is nearer than the solver's tolerance may be a contact.
    ASSERT_LE(with_sign, expected.high + 2 * off);
    if (expected.low > toleranceOf<S>(s.away)) {
      ASSERT_GE(with_sign, expected.low - 2 * off);
    } else if (with_sign <= 0) {
      const auto contact = pairing.collide(s, i % 2, fcl::GST_LIBCCD, 1, true);
      ASSERT_EQ(contact.numContacts(), 1u);
      ASSERT_EQ(with_sign, -static_cast<double>(contact.getContact(0).penetration_depth));
    }
  }
  EXPECT_GT(apart, count / 5) << "of " << count;
  EXPECT_GT(touching, count / 5) << "of " << count;
}

/// Conservative answers: never a false "free", and not far from what is.
template <typename S>
void checkConservative(const Partner<S>& row) {
  const Raw raw = modelMesh();
  const Solids solids = solidsOf(raw);
  Options options;
  options.answer = Answer::kConservative;
  options.depth = 6;
  // The ball about a cell of this depth.
  const double wide = std::sqrt(3.0) * 2.2 / 32;
  int i = -1, hits = 0;
  std::map<Subdivision, std::unique_ptr<Model<S>>> models;
  for (const auto subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    options.subdivision = subdivision;
    models[subdivision] = std::make_unique<Model<S>>(raw.mesh(), options);
  }
  for (const auto& s : situations<S>(solids, row.solids, 24)) {
    SCOPED_TRACE("situation " + std::to_string(++i));
    const Interval expected = distanceOf(solids, s.modelInPartner(), row.solids);
    const double off = toleranceOf<S>(s.away);
    for (const auto& model : models) {
      const Pairing<S> pairing{*model.second, *row.geometry};
      for (const auto solver : {fcl::GST_LIBCCD, fcl::GST_INDEP}) {
        std::size_t contacts[2];
        for (const bool turned : {false, true}) {
          const auto all = pairing.collide(s, turned, solver, kAll, true);
          contacts[turned] = all.numContacts();
          const double d = static_cast<double>(pairing.distance(s, turned, solver).min_distance);
          ASSERT_EQ(pairing.collide(s, turned, solver, 1, false).isCollision(), all.isCollision());
          ASSERT_LE(d, expected.high + off);
          ASSERT_GE(d, expected.low - wide);
          if (all.isCollision()) {
            ASSERT_LE(expected.low, wide);
          } else {
            ASSERT_GE(d, 0);
            ASSERT_FALSE(expected.meets() && (!row.is_mesh || d > 0)) << "missed";
          }
          for (std::size_t k = 0; k < all.numContacts(); ++k) {
            const auto& c = all.getContact(k);
            ASSERT_EQ(c.o1, &pairing.first(turned));
            ASSERT_EQ(c.o2, &pairing.second(turned));
            ASSERT_NEAR(c.normal.norm(), 1, 1e-5);
            ASSERT_GE(c.penetration_depth, 0);
          }
        }
        ASSERT_EQ(contacts[0], contacts[1]) << "the order matters";
        hits += contacts[0] > 0;
      }
    }
  }
  EXPECT_GT(hits, 96 / 5);
  EXPECT_LT(hits, 96 * 19 / 20);
}

/// A model of one triangle: what a contact says about two pieces is then about the two geometries.
template <typename S>
void checkOneTriangle(const Partner<S>& row) {
  Raw raw;
  raw.addTriangle({-0.5, -0.25, 0.125}, {0.75, -0.125, -0.25}, {0, 0.625, 0.25});
  const Solids solids = solidsOf(raw);
  const Model<S> model(raw.mesh());
  const Pairing<S> pairing{model, *row.geometry};
  int parted = 0, i = -1;
  for (const auto& s : situations<S>(solids, row.solids, 40)) {
    SCOPED_TRACE("situation " + std::to_string(++i));
    const double off = 20 * toleranceOf<S>(s.away);
    for (const bool turned : {false, true}) {
      const auto result = pairing.collide(s, turned, fcl::GST_LIBCCD, kAll, true);
      if (result.numContacts() != 1) continue;
      const auto& c = result.getContact(0);
      const fcl::Vector3<S> moved = c.normal * (c.penetration_depth * S(1.001) + static_cast<S>(off));
      Situation<S> after = s;
      (turned ? after.X : after.Y).translation() += moved;
      ASSERT_FALSE(pairing.collide(after, turned, fcl::GST_LIBCCD, 1, false).isCollision());
      ASSERT_GT(pairing.distance(after, turned, fcl::GST_LIBCCD).min_distance, 0);
      ++parted;
    }
  }
  EXPECT_GT(parted, 10);
}

}  // namespace bocst::test

/// The matrix in S, as tests of the suite given.
#define BOCST_TEST_MATRIX(Suite, S)                                                                         \
  class Suite : public testing::TestWithParam<const char*> {};                                              \
  TEST_P(Suite, Collide) { bocst::test::checkCollide<S>(bocst::test::partner<S>(GetParam())); }             \
  TEST_P(Suite, EdgeOfFcl) { bocst::test::checkEdge<S>(bocst::test::partner<S>(GetParam())); }              \
  TEST_P(Suite, Distance) { bocst::test::checkDistance<S>(bocst::test::partner<S>(GetParam())); }           \
  TEST_P(Suite, Conservative) { bocst::test::checkConservative<S>(bocst::test::partner<S>(GetParam())); }   \
  INSTANTIATE_TEST_SUITE_P(Shapes, Suite, testing::ValuesIn(bocst::test::kShapes), bocst::test::testName);  \
  INSTANTIATE_TEST_SUITE_P(Unions, Suite, testing::ValuesIn(bocst::test::kUnions), bocst::test::testName);  \
  class Suite##OnePiece : public testing::TestWithParam<const char*> {};                                    \
  TEST_P(Suite##OnePiece, Parts) { bocst::test::checkOneTriangle<S>(bocst::test::partner<S>(GetParam())); } \
  INSTANTIATE_TEST_SUITE_P(Shapes, Suite##OnePiece, testing::ValuesIn(bocst::test::kShapes), bocst::test::testName)
