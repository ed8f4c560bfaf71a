// SPDX-License-Identifier: BSD-3-Clause
//
// Two small meshes on an integer grid, poses that are exact on it, options and a history; every answer of collide,
// distance and continuousCollide is compared with exact arithmetic on all pairs of triangles.
#include <bocst/bocst.h>
#include <fcl/geometry/bvh/BVH_model.h>

#include <cmath>
#include <limits>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include "fuzz/fuzz.h"
#include "fuzz/grid.h"

namespace bocst::fuzz {
namespace {

struct Counts {
  std::uint64_t inputs = 0, pairs = 0, degenerate = 0, touching = 0, verdicts = 0, distances = 0, times = 0;
} counts;

struct GridMesh {
  std::vector<Point> vertices;
  std::vector<std::array<std::size_t, 3>> triangles;

  Corners corners(std::size_t t) const {
    return {vertices[triangles[t][0]], vertices[triangles[t][1]], vertices[triangles[t][2]]};
  }
};

bool hasExtent(const GridMesh& mesh) {
  const auto differ = [&](const Point& p) { return !(p == mesh.vertices.front()); };
  return std::any_of(mesh.vertices.begin(), mesh.vertices.end(), differ);
}

/// p -> (m p) / h + t, exactly; m / h is a rotation.
struct GridPose {
  std::array<Point, 3> m{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};  // rows
  Integer h = 1;
  Point t{0, 0, 0};

  Point turned(const Point& p) const { return {dot(m[0], p), dot(m[1], p), dot(m[2], p)}; }
  Point turnedBack(const Point& p) const {
    return {m[0].x * p.x + m[1].x * p.y + m[2].x * p.z, m[0].y * p.x + m[1].y * p.y + m[2].y * p.z,
            m[0].z * p.x + m[1].z * p.y + m[2].z * p.z};
  }
};

/// One of the 24 rotations of the cube.
std::array<Point, 3> cubeRotation(int index) {
  static const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  const int* order = orders[index % 6];
  const int signs = index / 6 % 4;
  Integer s[3] = {signs & 1 ? -1 : 1, signs & 2 ? -1 : 1, 1};
  s[2] = s[0] * s[1] * (index % 6 < 3 ? 1 : -1);  // determinant 1
  std::array<Point, 3> m{};
  for (std::size_t i = 0; i < 3; ++i) {
    m[i] = {order[i] == 0 ? s[i] : 0, order[i] == 1 ? s[i] : 0, order[i] == 2 ? s[i] : 0};
  }
  return m;
}

GridPose readPose(Bytes& in, int range) {
  GridPose pose;
  const int kind = in.next();
  pose.m = cubeRotation(in.below(24));
  if (kind % 8 == 7) {  // not exact in S
    static const Integer triples[3][3] = {{3, 4, 5}, {5, 12, 13}, {8, 15, 17}};
    const Integer* c = triples[kind / 8 % 3];
    const std::array<Point, 3> r = pose.m;
    pose.h = c[2];
    pose.m = {c[0] * r[0] - c[1] * r[1], c[1] * r[0] + c[0] * r[1], c[2] * r[2]};
  }
  const auto shift = [&] { return Integer(in.below(2 * range + 1)) - range; };
  pose.t = {shift(), shift(), shift()};
  return pose;
}

class Scene {
 public:
  Scene(const std::uint8_t* data, std::size_t size) : in_(data, size) {}

  template <typename S>
  void run();
  bool isFloat() { return in_.flip(); }

 private:
  template <typename S>
  struct Side {
    std::shared_ptr<Model<S>> model;
    std::shared_ptr<fcl::CollisionGeometry<S>> geometry;  // the model, or FCL's mesh of the same triangles
    Options options;
    Integer margin_eighths = 0;
    GridMesh mesh;
  };

  Point readPoint(int range) {
    const auto c = [&] { return Integer(in_.below(2 * range + 1)) - range; };
    const Integer x = c(), y = c(), z = c();
    return {x, y, z};
  }
  GridMesh readMesh(int range, const GridMesh* other, const GridPose& pose);
  Options readOptions(bool conservative);
  template <typename S>
  std::shared_ptr<const Mesh> meshOf(const GridMesh& mesh) const;
  Eigen::Vector3d position(const Point& p) const {
    return scale_ * Eigen::Vector3d(static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z));
  }
  std::vector<Eigen::Vector3d> positions(const GridMesh& mesh) const;
  template <typename S>
  fcl::Transform3<S> inWorld(const GridPose& pose) const;
  template <typename S>
  void makeBvh(Side<S>& side);
  void compute(const GridMesh& a, const GridMesh& b, const GridPose& pose);
  template <typename S>
  void ask(Side<S>& a, Side<S>& b, const GridPose& pose, int what);
  template <typename S>
  void askOrder(const Side<S>& a, const Side<S>& b, const GridPose& pose, bool swapped, int what);
  void askTime(const Side<double>& a, const Side<double>& b, const GridPose& pose);
  void change(Side<float>& side, int what) { changeSide(side, what); }
  void change(Side<double>& side, int what) { changeSide(side, what); }
  template <typename S>
  void changeSide(Side<S>& side, int what);

  std::size_t at(std::size_t i, std::size_t j) const { return i * second_.size() + j; }
  /// Of a pair of triangles, in steps of the grid.
  double distance(std::size_t ij) {
    double& d = distance_[ij];
    if (d >= 0) return d;
    const std::size_t i = ij / second_.size(), j = ij % second_.size();
    d = fuzz::distance(first_[i], second_[j]) / fineness_;
    if (d == 0 && rounded_) d = roundedDistance(i, j);
    return d;
  }
  double roundedDistance(std::size_t i, std::size_t j) const;
  // What touches on the grid does so, rounded to doubles, up to rounding.
  bool touches(std::size_t ij) { return rounded_ ? distance(ij) <= 4 * 0x1p-52 * magnitude_ : meet(ij); }
  bool hasArea(std::size_t ij) const {
    return fuzz::hasArea(first_[ij / second_.size()]) && fuzz::hasArea(second_[ij % second_.size()]);
  }
  double boxDistance(std::size_t ij) const {
    return fuzz::boxDistance(first_[ij / second_.size()], second_[ij % second_.size()]) / fineness_;
  }
  bool meet(std::size_t ij) { return boxDistance(ij) == 0 && distance(ij) == 0; }
  double leastDistance();
  std::string describe(const GridMesh& a, const GridMesh& b, const GridPose& pose) const;
  template <typename S>
  [[noreturn]] void fail(const std::string& what, const Side<S>& a, const Side<S>& b, const GridPose& pose) const;

  Bytes in_;
  int range_a_ = 1, range_b_ = 1;
  double scale_ = 1;
  bool rounded_ = false;  // the scale is no power of two, so coordinates are doubles near the grid
  GridPose world_;        // of the first mesh
  // The triangles at the pose, on a grid `fineness_` times as fine, and about each pair: do they meet, have both an
  // area, and how far apart are they (negative: not asked yet)?
  // The triangles at the pose, on a grid `fineness_` times as fine, and how far apart each two are (negative: not
  // asked).
  std::vector<Corners> first_, second_;
  double fineness_ = 1;
  std::vector<double> distance_;
  const GridMesh *mesh_a_ = nullptr, *mesh_b_ = nullptr;
  GridPose pose_;
  double least_ = -1, magnitude_ = 0;
};

GridMesh Scene::readMesh(int range, const GridMesh* other, const GridPose& pose) {
  GridMesh mesh;
  const int points = 1 + in_.below(16), triangles = 1 + in_.below(24);
  for (int i = 0; i < points; ++i) mesh.vertices.push_back(readPoint(range));
  const auto old = [&] { return static_cast<std::size_t>(in_.below(points)); };
  const auto add = [&](const Point& p) {
    mesh.vertices.push_back(p);
    return mesh.vertices.size() - 1;
  };
  for (int t = 0; t < triangles; ++t) {
    const int kind = in_.below(8);
    const std::size_t a = old();
    if (kind == 4) {
      mesh.triangles.push_back({a, a, a});
    } else if (kind == 5) {
      const std::size_t b = old();
      mesh.triangles.push_back({a, b, t % 2 == 0 ? a : b});
    } else if (kind == 6) {  // three places on a line
      const Point d = readPoint(std::min(range, 3)), p = mesh.vertices[a];
      const Integer i = in_.below(7) - 3, j = in_.below(7) - 3;
      const std::size_t b = add(p + i * d), c = add(p + j * d);
      mesh.triangles.push_back({a, b, c});
    } else if (kind == 7 && other != nullptr && pose.h == 1) {  // as one of the other mesh, at the first pose
      const auto n = static_cast<int>(other->triangles.size());
      const Corners c = other->corners(static_cast<std::size_t>(in_.below(n)));
      const std::size_t i = add(pose.turnedBack(c[0] - pose.t)), j = add(pose.turnedBack(c[1] - pose.t)),
                        k = add(pose.turnedBack(c[2] - pose.t));
      mesh.triangles.push_back({i, j, k});
    } else {
      const std::size_t b = old(), c = old();
      mesh.triangles.push_back({a, b, c});
    }
  }
  return mesh;
}

Options Scene::readOptions(bool conservative) {
  Options options;
  options.oracle = OracleKind::kCpu;
  options.answer = conservative ? Answer::kConservative : Answer::kExact;
  options.subdivision = in_.flip() ? Subdivision::kOctree : Subdivision::kBono;
  options.depth = 1 + in_.below(7);
  if (in_.below(4) == 0) options.dimension = 1 + in_.below(65536);
  if (in_.below(4) == 0) options.memory_budget = static_cast<std::size_t>(in_.below(65536));
  return options;
}

std::vector<Eigen::Vector3d> Scene::positions(const GridMesh& mesh) const {
  std::vector<Eigen::Vector3d> result;
  for (const Point& p : mesh.vertices) result.push_back(position(p));
  return result;
}

template <typename S>
std::shared_ptr<const Mesh> Scene::meshOf(const GridMesh& mesh) const {
  std::vector<fcl::Triangle> triangles;
  for (const auto& t : mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  return std::make_shared<const Mesh>(positions(mesh), triangles);
}

template <typename S>
fcl::Transform3<S> Scene::inWorld(const GridPose& pose) const {
  fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
  const Point t = world_.turned(pose.t) + world_.t;
  const Integer p[3] = {t.x, t.y, t.z};
  for (int i = 0; i < 3; ++i) {
    const Point& w = world_.m[static_cast<std::size_t>(i)];
    const Point row = w.x * pose.m[0] + w.y * pose.m[1] + w.z * pose.m[2];
    const auto h = static_cast<double>(pose.h);
    X.linear().row(i) << static_cast<S>(static_cast<double>(row.x) / h), static_cast<S>(static_cast<double>(row.y) / h),
        static_cast<S>(static_cast<double>(row.z) / h);
    X.translation()[i] = static_cast<S>(scale_ * static_cast<double>(p[i]));
  }
  return X;
}

template <typename S>
void Scene::makeBvh(Side<S>& side) {
  auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSS<S>>>();
  std::vector<fcl::Vector3<S>> vertices;
  for (const Eigen::Vector3d& v : positions(side.mesh)) vertices.push_back(v.cast<S>());
  std::vector<fcl::Triangle> triangles;
  for (const auto& t : side.mesh.triangles) triangles.emplace_back(t[0], t[1], t[2]);
  bvh->beginModel();
  bvh->addSubModel(vertices, triangles);
  bvh->endModel();
  side.geometry = bvh;
}

// All pairs, on a grid that is pose.h times as fine.
void Scene::compute(const GridMesh& a, const GridMesh& b, const GridPose& pose) {
  Integer largest = 0;
  const auto note = [&](const Point& c) {
    largest = std::max({largest, std::abs(c.x), std::abs(c.y), std::abs(c.z)});
    return c;
  };
  first_.clear();
  second_.clear();
  mesh_a_ = &a;
  mesh_b_ = &b;
  pose_ = pose;
  for (std::size_t i = 0; i < a.triangles.size(); ++i) {
    const Corners c = a.corners(i);
    first_.push_back({note(pose.h * c[0]), note(pose.h * c[1]), note(pose.h * c[2])});
  }
  for (std::size_t j = 0; j < b.triangles.size(); ++j) {
    const Corners c = b.corners(j);
    second_.push_back({note(pose.turned(c[0]) + pose.h * pose.t), note(pose.turned(c[1]) + pose.h * pose.t),
                       note(pose.turned(c[2]) + pose.h * pose.t)});
  }
  if (largest > kMaxCoordinate) throw std::logic_error("the harness made coordinates that its arithmetic cannot take");
  // What the meshes' own coordinates and the pose round is as large as they are.
  for (const GridMesh* m : {&a, &b}) {
    for (const Point& c : m->vertices) note(pose.h * c);
  }
  note(pose.h * pose.t);
  fineness_ = static_cast<double>(pose.h);
  magnitude_ = static_cast<double>(largest) / fineness_ + 1;
  distance_.assign(first_.size() * second_.size(), -1);
  least_ = -1;
}

// Of the doubles that the meshes and the pose are, exactly.
double Scene::roundedDistance(std::size_t i, std::size_t j) const {
  exact::Corners p, q;
  for (std::size_t k = 0; k < 3; ++k) {
    p[k] = position(mesh_a_->corners(i)[k]);
    q[k] = position(mesh_b_->corners(j)[k]);
  }
  Eigen::Isometry3d X;
  X.matrix() = inWorld<double>(pose_).matrix();
  return std::sqrt(static_cast<double>(exact::squaredDistance(p, X, q))) / scale_;
}

double Scene::leastDistance() {
  if (least_ >= 0) return least_;
  least_ = std::numeric_limits<double>::infinity();
  for (std::size_t ij = 0; ij < distance_.size(); ++ij) {
    if (boxDistance(ij) < least_) least_ = std::min(least_, distance(ij));
  }
  return least_;
}

std::string Scene::describe(const GridMesh& a, const GridMesh& b, const GridPose& pose) const {
  std::ostringstream out;
  for (const GridMesh* m : {&a, &b}) {
    out << (m == &a ? "first:" : "\nsecond:");
    for (std::size_t t = 0; t < m->triangles.size(); ++t) {
      out << "\n  " << t << ":";
      for (const Point& c : m->corners(t)) out << " (" << c.x << "," << c.y << "," << c.z << ")";
    }
  }
  out << "\nsecond in first: rows";
  for (const Point& r : pose.m) out << " (" << r.x << "," << r.y << "," << r.z << ")";
  out << " / " << pose.h << " + (" << pose.t.x << "," << pose.t.y << "," << pose.t.z << "), first in world + ("
      << world_.t.x << "," << world_.t.y << "," << world_.t.z << "), all times " << scale_ << "\n";
  return out.str();
}

template <typename S>
void Scene::fail(const std::string& what, const Side<S>& a, const Side<S>& b, const GridPose& pose) const {
  std::ostringstream out;
  out.precision(17);
  out << what << " (" << (std::is_same<S, float>::value ? "float" : "double");
  for (const auto* side : {&a, &b}) {
    const Options& o = side->options;
    out << "; " << (side->model ? "model" : "BVHModel") << (o.answer == Answer::kExact ? " exact" : " conservative")
        << (o.subdivision == Subdivision::kBono ? " bono" : " octree") << " depth " << o.depth << " dimension "
        << o.dimension << " budget " << o.memory_budget << " margin " << side->margin_eighths << "/8";
  }
  out << ")\n" << describe(a.mesh, b.mesh, pose);
  throw Failure(out.str());
}

template <typename S>
void Scene::askOrder(const Side<S>& a, const Side<S>& b, const GridPose& pose, bool swapped, int what) {
  const fcl::Transform3<S> X_WA = inWorld<S>(GridPose()), X_WB = inWorld<S>(pose);
  const bool conservative = a.options.answer == Answer::kConservative || b.options.answer == Answer::kConservative;
  const double margin = static_cast<double>(a.margin_eighths + b.margin_eighths) / 8;
  const auto world = static_cast<double>(std::max({std::abs(world_.t.x), std::abs(world_.t.y), std::abs(world_.t.z)}));
  const double blur = 64 * static_cast<double>(std::numeric_limits<S>::epsilon()) * (magnitude_ + world + margin);
  const char* const order = swapped ? ", second first" : "";

  const auto must_meet = [&](std::size_t ij) {
    if (margin > 0) return margin > blur && distance(ij) <= margin - blur;
    // Of other triangles FCL's test is the judge, with its rounding where there is any.
    return pose.h == 1 && (!rounded_ || !hasArea(ij)) && touches(ij);
  };
  const auto may_meet = [&](std::size_t ij) {
    return boxDistance(ij) <= margin + blur && distance(ij) <= margin + blur;
  };
  const auto collide = [&](const fcl::CollisionRequest<S>& request, fcl::CollisionResult<S>& result) {
    const auto *o1 = a.geometry.get(), *o2 = b.geometry.get();
    return swapped ? fcl::collide(o2, X_WB, o1, X_WA, request, result)
                   : fcl::collide(o1, X_WA, o2, X_WB, request, result);
  };

  bool must = false;
  for (std::size_t ij = 0; ij < distance_.size(); ++ij) must = must || must_meet(ij);
  const auto may = [&] { return leastDistance() <= margin + blur; };
  {
    fcl::CollisionResult<S> result;
    const bool hit = collide(fcl::CollisionRequest<S>(1, what % 2 != 0), result) > 0;
    ++counts.verdicts;
    if (must && !hit) fail<S>(std::string("FALSE FREE: collide") + order, a, b, pose);
    if (hit && !conservative && !may()) fail<S>(std::string("collide hits what is apart") + order, a, b, pose);
  }
  {
    fcl::CollisionResult<S> result;
    const bool with_contacts = what % 4 / 2 != 0;
    const std::size_t n = collide(fcl::CollisionRequest<S>(1000000, with_contacts), result);
    if (n != result.numContacts()) fail<S>("collide returns another number than it stores", a, b, pose);
    if (must && n == 0) fail<S>(std::string("FALSE FREE: contacts") + order, a, b, pose);
    if (n != 0 && !conservative && !may()) fail<S>(std::string("contacts of what is apart") + order, a, b, pose);
    std::set<std::pair<std::size_t, std::size_t>> seen;
    for (std::size_t k = 0; k < n; ++k) {
      const fcl::Contact<S>& c = result.getContact(k);
      const auto *o1 = a.geometry.get(), *o2 = b.geometry.get();
      if (c.o1 != (swapped ? o2 : o1) || c.o2 != (swapped ? o1 : o2)) fail<S>("a contact names others", a, b, pose);
      if (with_contacts && (!c.normal.allFinite() || !c.pos.allFinite() || !(c.penetration_depth >= 0) ||
                            !(std::abs(c.normal.norm() - 1) < S(1e-3)))) {
        fail<S>("a contact with no normal, place or depth", a, b, pose);
      }
      if (conservative) continue;
      const auto i = static_cast<std::size_t>(swapped ? c.b2 : c.b1),
                 j = static_cast<std::size_t>(swapped ? c.b1 : c.b2);
      if (i >= a.mesh.triangles.size() || j >= b.mesh.triangles.size()) fail<S>("a contact of no triangle", a, b, pose);
      if (!seen.emplace(i, j).second) fail<S>("a contact twice", a, b, pose);
    }
    // Fewer are some of all, in the same order and with the same numbers.
    fcl::CollisionResult<S> few;
    const std::size_t most = 1 + static_cast<std::size_t>(what) % 3;
    collide(fcl::CollisionRequest<S>(most, true), few);
    if (few.numContacts() != std::min(most, n)) fail<S>("a request for few contacts gets another number", a, b, pose);
    std::size_t next = 0;
    for (std::size_t k = 0; k < few.numContacts(); ++k, ++next) {
      const fcl::Contact<S>& c = few.getContact(k);
      while (next < n && (c.b1 != result.getContact(next).b1 || c.b2 != result.getContact(next).b2)) ++next;
      if (next == n) fail<S>("a request for few contacts gets others", a, b, pose);
      const fcl::Contact<S>& d = result.getContact(next);
      if (with_contacts && (c.normal != d.normal || c.pos != d.pos)) {
        fail<S>("a request for few contacts gets other numbers", a, b, pose);
      }
    }
    if (!conservative) {
      for (std::size_t i = 0; i < a.mesh.triangles.size(); ++i) {
        for (std::size_t j = 0; j < b.mesh.triangles.size(); ++j) {
          const bool found = seen.count({i, j}) != 0;
          const std::string pair = std::to_string(i) + " x " + std::to_string(j) + order;
          if (!found && must_meet(at(i, j))) fail<S>("MISSED PAIR " + pair, a, b, pose);
          if (found && !may_meet(at(i, j))) fail<S>("pair " + pair + " is apart", a, b, pose);
          ++counts.pairs;
          counts.degenerate += !hasArea(at(i, j));
          counts.touching += meet(at(i, j));
        }
      }
    }
  }
  if (what % 8 / 4 == 0) {
    fcl::DistanceRequest<S> request(true);
    fcl::DistanceResult<S> result;
    const auto *o1 = a.geometry.get(), *o2 = b.geometry.get();
    const S said = swapped ? fcl::distance(o2, X_WB, o1, X_WA, request, result)
                           : fcl::distance(o1, X_WA, o2, X_WB, request, result);
    const double d = static_cast<double>(said) / scale_;
    // The rounding of the answer, and that of a rotation which S cannot hold.
    const double near = (std::is_same<S, float>::value ? 1e-5 : 1e-10) * (magnitude_ + world);
    ++counts.distances;
    const double least = leastDistance();
    const auto complain = [&](const char* text) {
      std::ostringstream out;
      out.precision(17);
      out << text << order << ": " << d << ", exactly " << least << ", triangles " << result.b1 << ", " << result.b2;
      fail<S>(out.str(), a, b, pose);
    };
    if (!(d >= 0) || d > least + near) complain("DISTANCE too large");
    if (!conservative) {
      if (d < least - near) complain("distance too small");
      const auto i = static_cast<std::size_t>(swapped ? result.b2 : result.b1),
                 j = static_cast<std::size_t>(swapped ? result.b1 : result.b2);
      if (i >= a.mesh.triangles.size() || j >= b.mesh.triangles.size()) complain("distance of no triangles");
      if (distance(at(i, j)) > least + 2 * near) complain("distance of other triangles");
    }
  }
}

// The second mesh moves along a way of 8 steps; where the two meet at one, contact is no later.
void Scene::askTime(const Side<double>& a, const Side<double>& b, const GridPose& pose) {
  const Point way = readPoint(8);
  GridPose end = pose;
  end.t = pose.t + way;
  fcl::ContinuousCollisionRequest<double> request;
  request.ccd_motion_type = fcl::CCDM_TRANS;
  fcl::ContinuousCollisionResult<double> result;
  const fcl::Transform3<double> X_WA = inWorld<double>(GridPose());
  fcl::continuousCollide(a.geometry.get(), X_WA, X_WA, b.geometry.get(), inWorld<double>(pose), inWorld<double>(end),
                         request, result);
  ++counts.times;
  GridMesh fine_a = a.mesh, fine_b = b.mesh;
  for (GridMesh* m : {&fine_a, &fine_b}) {
    for (Point& p : m->vertices) p = 8 * p;
  }
  for (Integer step = 0; step <= 8; ++step) {
    GridPose at_step = pose;
    at_step.t = 8 * pose.t + step * way;
    compute(fine_a, fine_b, at_step);
    if (leastDistance() != 0 || (pose.h != 1 && step != 8)) continue;
    if (pose.h != 1) break;  // touching on a grid that the rotation is not exact on
    const double t = static_cast<double>(step) / 8;
    if (!result.is_collide || result.time_of_contact > t + 1e-9) {
      std::ostringstream out;
      out << "LATE: contact at " << t << ", said " << (result.is_collide ? result.time_of_contact : 2) << ", way ("
          << way.x << "," << way.y << "," << way.z << ")";
      fail<double>(out.str(), a, b, pose);
    }
    break;
  }
}

template <typename S>
void Scene::ask(Side<S>& a, Side<S>& b, const GridPose& pose, int what) {
  compute(a.mesh, b.mesh, pose);
  askOrder<S>(a, b, pose, false, what);
  askOrder<S>(a, b, pose, true, what);
}

template <typename S>
void Scene::changeSide(Side<S>& side, int what) {
  if (!side.model) return;
  switch (what) {
    case 0:
      side.model->prune(Clock::now() + std::chrono::hours(1));
      break;
    case 1:
      side.model->expandAll(1 + in_.below(4));
      break;
    case 2:
      for (Point& p : side.mesh.vertices) {
        if (in_.flip()) p = readPoint(range_a_);
      }
      if (!hasExtent(side.mesh)) side.mesh.vertices.front().x += 1;
      side.model->updateVertices(positions(side.mesh));
      break;
    default:
      side.model->prune();
      break;
  }
}

template <typename S>
void Scene::run() {
  constexpr bool is_double = std::is_same<S, double>::value;
  // In float, FCL's test is exact on small grids only.
  static const int ranges[] = {1, 2, 3, 4, 0, 1, 2, 3, 16, 200, 3000};
  const int kinds = is_double ? 11 : 8;
  range_a_ = ranges[in_.below(kinds)];
  range_b_ = ranges[in_.below(kinds)];
  static const int scales_double[] = {0, 0, 0, 10, -30, 100, -100}, scales_float[] = {0, 0, 0, 4, -4, 10, -10};
  scale_ = std::ldexp(1, (is_double ? scales_double : scales_float)[in_.below(7)]);
  const int far = in_.below(8);
  world_.m = cubeRotation(in_.below(24));
  static const Integer distances[] = {0, 0, 0, 0, 3, 1000, 1 << 20, Integer(1) << 40};
  const Integer distance = distances[is_double ? far : std::min(far, 6)];
  world_.t = {distance, -distance, distance / 2};
  if (is_double && in_.below(4) == 3) {
    rounded_ = true;
    scale_ *= 0.1;
    world_ = GridPose();
  }

  const int mode = in_.next();
  const bool conservative = mode % 8 == 0, beside_bvh = mode % 8 == 1;
  const int reach = std::min(8 + std::max(range_a_, range_b_), is_double ? 3000 : 8);
  GridPose pose = readPose(in_, reach);
  Side<S> a, b;
  a.options = readOptions(conservative);
  b.options = readOptions(conservative && in_.flip());
  if (in_.below(4) == 0) {
    a.margin_eighths = in_.below(32);
    if (!beside_bvh) b.margin_eighths = in_.below(4);
  }
  a.mesh = readMesh(range_a_, nullptr, pose);
  b.mesh = readMesh(range_b_, &a.mesh, pose);
  // All cells of a mesh without extent are within any margin of the partner's: nobody wants their pairs.
  if (conservative && !(hasExtent(a.mesh) && hasExtent(b.mesh))) a.margin_eighths = b.margin_eighths = 0;
  // A margin may make pairs of all cells of both: 10^8 and more at depth 7.
  if (conservative && a.margin_eighths + b.margin_eighths > 0) {
    a.options.depth = std::min(a.options.depth, 5);
    b.options.depth = std::min(b.options.depth, 5);
  }
  a.options.margin = scale_ * static_cast<double>(a.margin_eighths) / 8;
  b.options.margin = scale_ * static_cast<double>(b.margin_eighths) / 8;
  a.geometry = a.model = std::make_shared<Model<S>>(meshOf<S>(a.mesh), a.options);
  if (beside_bvh) {
    makeBvh(b);
  } else {
    b.geometry = b.model = std::make_shared<Model<S>>(meshOf<S>(b.mesh), b.options);
  }
  for (int step = 0; step < 4; ++step) {
    const int what = in_.next();
    ask<S>(a, b, pose, what);
    if constexpr (is_double) {
      if (what % 16 == 15 && range_a_ <= 200 && range_b_ <= 200 && a.margin_eighths + b.margin_eighths == 0 &&
          !rounded_) {
        askTime(a, b, pose);
      }
    }
    if (in_.empty()) break;
    const int changes = in_.next();
    change(a, changes % 8);
    change(b, changes / 8 % 8);
    pose = readPose(in_, reach);
  }
}

}  // namespace

const char* const kTokens[] = {nullptr};

void testOneInput(const std::uint8_t* data, std::size_t size) {
  ++counts.inputs;
  Scene scene(data, size);
  if (scene.isFloat()) {
    scene.run<float>();
  } else {
    scene.run<double>();
  }
}

std::string summary() {
  std::ostringstream out;
  out << counts.inputs << " inputs: " << counts.pairs << " pairs of triangles checked exactly (" << counts.degenerate
      << " with a segment or a point, " << counts.touching << " in touch), " << counts.verdicts << " verdicts, "
      << counts.distances << " distances, " << counts.times << " times of contact";
  return out.str();
}

}  // namespace bocst::fuzz
