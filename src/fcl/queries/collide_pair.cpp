// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/queries/collide_pair.h"

#include <fcl/config.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/math/geometry.h>
#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/pair.h"
#include "fcl/adapters/validate.h"
#include "fcl/queries/collide_octree.h"
#include "fcl/queries/collide_query.h"
#include "fcl/queries/collide_row.h"
#include "fcl/queries/collide_shape.h"
#include "fcl/queries/contact_order.h"
#include "fcl/queries/grow_together.h"
#include "fcl/queries/inside.h"
#include "fcl/queries/inside_contact.h"
#include "fcl/queries/query_scope.h"
#include "geometry/triangle.h"
#include "query/collide/pair_walk.h"
#include "query/collide/sphere_walk.h"
#include "query/collide/tree_walk.h"
#include "query/cull/far_apart.h"
#include "query/leaf/pair_set.h"
#include "query/sides/box_side.h"

namespace bocst::fcl_adapter {
namespace {

using query::Corners;
using query::SimilarityTransform;
using query::TreeSide;

/// The triangles of one side as FCL computes with them: corners in S, in the geometry's frame. Of a model or, where
/// `bvh` is given, of that.
template <typename S>
class Triangles {
 public:
  explicit Triangles(const tree::Tree& tree) : mesh_(tree.surface().mesh.get()) {}
  explicit Triangles(const BvhSide& bvh) : bvh_(&bvh) {}

  fcl::Vector3<S> corner(std::uint32_t t, int k) const {
    if (bvh_ != nullptr) return bvh_->vertex(t, k).template cast<S>();
    return mesh_->vertex(mesh_->indices(t)[static_cast<std::size_t>(k)]).template cast<S>();
  }
  /// Triangle t is about to be asked for, and now its corners.
  void prefetch(std::uint32_t t) const {
    if (bvh_ != nullptr) return bvh_->prefetch(t);
    __builtin_prefetch(&mesh_->indices(t));
  }
  void prefetchCorners(std::uint32_t t) const {
    if (bvh_ != nullptr) return bvh_->prefetchCorners(t);
    for (const std::uint32_t v : mesh_->indices(t)) {
      // A vertex may lie in two cache lines.
      __builtin_prefetch(&mesh_->vertex(v)[0]);
      __builtin_prefetch(&mesh_->vertex(v)[2]);
    }
  }

 private:
  const Mesh* mesh_ = nullptr;  // null where the host has none: conservative answers ask for no triangle
  const BvhSide* bvh_ = nullptr;
};

/// A contact before it is one of FCL's: ids in the caller's order, and how the two touch, in the world.
struct Met {
  double place;  // of cells, see ContactOrder; of triangles 0
  std::uint64_t b1, b2;
  query::ContactPoint contact;

  bool operator<(const Met& other) const { return std::tie(place, b1, b2) < std::tie(other.place, other.b1, other.b2); }
};

/// A pair of triangles and its place in the order of contacts.
struct PlacedPair {
  double place;
  std::uint64_t key;

  bool operator<(const PlacedPair& other) const { return place != other.place ? place < other.place : key < other.key; }
};

/// Turns the pairs of a walk into contacts and cost sources; triangles are those of the caller's first and second
/// geometry.
///
/// A walk finds pairs in an order that depends on what is resident. So unless any pair will do, contacts are sorted by
/// their ids. If there may be more than are asked for, few are chosen by ContactOrder, which lets the walk be cut at
/// the place of the last of them; many are the first by their ids of all that are gathered.
template <typename S>
class Collector : public query::Visitor {
 public:
  Collector(const CollideQuery<S>& q, const tree::Tree& a, const Triangles<S>& t1, const Triangles<S>& t2,
            double magnitude)
      : q_(q),
        order_(a),
        t1_(t1),
        t2_(t2),
        magnitude_(magnitude),
        margin_(q.margin),
        ends_at_first_(q.endsAtFirst()),
        left_(q.contactsLeft()),
        most_(std::max<std::size_t>(kMost, left_ < kUnlimited ? 4 * left_ : kUnlimited)),
        is_cut_(!ends_at_first_ && left_ > 0 && left_ <= FirstPairs::kMost && !q.request.enable_cost),
        s_(scratch()),
        cut_(order_.startCut()) {
    s_.met.clear();
    if (ends_at_first_) return;
    s_.seen.clear();
    s_.seen_cells.clear();
    s_.found.clear();
    if (is_cut_) {
      s_.first.start(left_);
      s_.first_cells.start(left_);
      cut_.cell_side = q.swapped ? 1 : 0;
    }
  }

  /// Where side A's cells lie in the world, and by how many of its lattice units positions may be off: the margin
  /// included.
  void setFrame(const lattice::Lattice& lattice, double tolerance) {
    origin_ = lattice.origin();
    unit_ = lattice.unit();
    position_tolerance_ = tolerance;
  }

  bool endsAtFirst() const override { return ends_at_first_; }
  const query::Cut* cut() const override { return is_cut_ ? &cut_ : nullptr; }

  bool triangles(std::uint32_t a, std::uint32_t b, bool certain) override {
    const std::uint32_t of_model = a;
    q_.inCallersOrder(a, b);
    const std::uint64_t key = keyOf(a, b, certain);
    if (ends_at_first_) return endsWith(key);
    if (is_cut_) {
      addFirst(of_model, key);
    } else if (s_.seen.insert(a, b)) {
      s_.found.push_back(key);
      if (s_.found.size() >= most_) lookAtFound();
    }
    return false;
  }

  bool cells(const query::CellLeaf& a, const query::CellLeaf& b) override {
    return addSpheres(q_.swapped ? b.id : a.id, a.id, a.sphere, b.id, b.sphere);
  }

  bool cellOfA(const query::CellLeaf& a, std::uint32_t b, const Eigen::Vector3d& point) override {
    if (!ends_at_first_ && !s_.seen_cells.insert(a.id, b)) return false;
    return addSpheres(a.id, a.id, a.sphere, b, {point, 0});
  }

  bool cellOfB(std::uint32_t a, const query::CellLeaf& b, const Eigen::Vector3d& point) override {
    if (!ends_at_first_ && !s_.seen_cells.insert(b.id, a)) return false;
    return addSpheres(b.id, a, {point, 0}, b.id, b.sphere);
  }

  /// To be called at the end of the walk.
  void finish() {
    if (ends_at_first_) return;
    if (is_cut_) {
      for (const PlacedPair& pair : s_.first.sort()) s_.found.push_back(pair.key);
      s_.met = s_.first_cells.sort();
    }
    lookAtFound();
    std::sort(s_.met.begin(), s_.met.end(),
              [](const Met& x, const Met& y) { return std::tie(x.b1, x.b2) < std::tie(y.b1, y.b2); });
    emit();
  }

 private:
  static constexpr double kEpsilon = static_cast<double>(std::numeric_limits<S>::epsilon());
  // In float, FCL's axes between slivers' all but parallel edges are rubbish, and it may say that they meet.
  static constexpr bool kTrustsApart = std::is_same<S, double>::value;
  // So many pairs are gathered before the ones too many are dropped.
  static constexpr std::size_t kMost = std::size_t{1} << 16, kUnlimited = std::size_t{1} << 40;

  // Orders pairs by their ids; triangle ids of the first geometry have at most 31 bits.
  static std::uint64_t keyOf(std::uint32_t a, std::uint32_t b, bool certain) {
    return std::uint64_t{a} << 33 | std::uint64_t{b} << 1 | std::uint64_t{!certain};
  }
  static std::uint32_t first(std::uint64_t key) { return static_cast<std::uint32_t>(key >> 33); }
  static std::uint32_t second(std::uint64_t key) { return static_cast<std::uint32_t>(key >> 1); }
  static bool isCertain(std::uint64_t key) { return (key & 1) == 0; }

  using FirstPairs = FirstItems<PlacedPair>;
  // Kept by the thread between queries.
  struct Scratch {
    query::PairSet<std::uint32_t> seen;
    query::PairSet<std::uint64_t> seen_cells;
    query::TrianglePairs pairs;
    FirstPairs first;                  // that touch, where the walk is cut
    FirstItems<Met> first_cells;       // the same where cells are in the pairs
    std::vector<std::uint64_t> found;  // keys of pairs of triangles that were not tested yet
    std::vector<Met> met;              // the first that touch, of those that were
  };
  static Scratch& scratch() {
    thread_local Scratch scratch;
    return scratch;
  }

  // A triangle so narrow, of its length or of its corners' coordinates, is a segment or a point but for rounding in S.
  static constexpr double kNarrow = std::is_same<S, double>::value ? 1e-14 : 45 * kEpsilon;
  static double longest(const Corners& t) {
    return std::max((t[1] - t[0]).cwiseAbs().maxCoeff(), (t[2] - t[0]).cwiseAbs().maxCoeff());
  }
  static bool isSliver(const Corners& t, double relative_width) {
    const double rounding =
        4 * kEpsilon * std::max({t[0].cwiseAbs().maxCoeff(), t[1].cwiseAbs().maxCoeff(), t[2].cwiseAbs().maxCoeff()});
    return relative_width <= std::max(kNarrow, rounding / longest(t));
  }
  // The squares of such products vanish in S, so FCL's axes separate nothing.
  static constexpr double kSmallestProduct = std::is_same<S, double>::value ? 1e-140 : 1e-15;

  // What distances near 0 may be off by.
  double rounding() const { return roundingOf<S>(magnitude_) / 2; }

  // Of triangles that certainly meet.
  bool needsCorners() const { return q_.request.enable_contact || q_.request.enable_cost; }

  // Most queries that miss never come here.
  void place() {
    if (placed_) return;
    fcl::relativeTransform(q_.X_W1.linear(), q_.X_W1.translation(), q_.X_W2.linear(), q_.X_W2.translation(), R_12_,
                           p_12_);
    place_.linear() = R_12_.template cast<double>();
    place_.translation() = p_12_.template cast<double>();
    if (q_.swapped) to_model_ = place_.inverse(Eigen::Affine);
    placed_ = true;
  }

  // Any pair that touches will do: does this one?
  bool endsWith(std::uint64_t key) {
    if (!isCertain(key)) {
      getCorners(&key, 1);
      if (!decide(key, 0, nullptr)) return false;
    }
    return q_.addContact(first(key), second(key), nullptr);
  }

  // Only the first so many that touch are wanted: is this one of them?
  void addFirst(std::uint32_t of_model, std::uint64_t key) {
    if (!s_.seen.insert(first(key), second(key))) return;
    getCorners(&key, 1);
    const PlacedPair pair{placeOf(of_model, 0), key};
    if (!s_.first.wants(pair) || !decide(key, 0, nullptr)) return;
    s_.first.add(pair);
    if (s_.first.isFull()) order_.setCut(s_.first.last().place, position_tolerance_, cut_);
  }

  // Of pair i of s_.pairs.
  double placeOf(std::uint32_t of_model, std::size_t i) const {
    if (margin_ > 0) return order_.placeOf(of_model);
    Corners p, q;
    s_.pairs.get(i, p, q);
    return order_.placeOf(of_model, p, q, to_model_);
  }

  // True when nothing more is asked for.
  bool emit() {
    bool ends = false;
    for (const Met& m : s_.met) {
      ends = q_.addContact(static_cast<std::intptr_t>(m.b1), static_cast<std::intptr_t>(m.b2), &m.contact);
    }
    return ends;
  }

  // Moves the first of what was found and touches to `met`, and forgets the rest of it.
  void lookAtFound() {
    constexpr std::size_t kBatch = query::TrianglePairs::kCapacity;
    std::vector<std::uint64_t>& found = s_.found;
    std::sort(found.begin(), found.end());
    const std::size_t before = s_.met.size();
    for (std::size_t i = 0; i < found.size(); i += kBatch) {
      for (std::size_t k = i + kBatch; k < std::min(i + 2 * kBatch, found.size()); ++k) {
        t1_.prefetchCorners(first(found[k]));
        t2_.prefetchCorners(second(found[k]));
      }
      for (std::size_t k = i + 2 * kBatch; k < std::min(i + 3 * kBatch, found.size()); ++k) {
        t1_.prefetch(first(found[k]));
        t2_.prefetch(second(found[k]));
      }
      decidePairs(&found[i], std::min(kBatch, found.size() - i));
      if (q_.request.enable_cost || s_.met.size() - before < left_) continue;
      break;  // What comes later comes behind what there is.
    }
    found.clear();
    keepFirst();
  }

  // Of what touches, only as much as is asked for.
  void keepFirst() {
    std::vector<Met>& met = s_.met;
    if (!std::is_sorted(met.begin(), met.end())) std::sort(met.begin(), met.end());
    if (met.size() > left_) met.resize(left_);
  }

  void decidePairs(const std::uint64_t* keys, std::size_t count) {
    if (!needsCorners() && std::all_of(keys, keys + count, isCertain)) {
      for (std::size_t i = 0; i < count; ++i) {
        s_.met.push_back({0, first(keys[i]), second(keys[i]), {}});
      }
      return;
    }
    getCorners(keys, count);
    query::ContactPoint contacts[query::TrianglePairs::kCapacity];
    const query::PenetrationVerdicts verdicts =
        query::trianglePenetrations(s_.pairs, 2 * rounding(), q_.request.enable_contact ? contacts : nullptr);
    for (std::size_t i = 0; i < count; ++i) {
      const bool meet = isCertain(keys[i]) || (verdicts.meet >> i & 1);
      if (meet && margin_ == 0) {
        addMet(keys[i], contacts[i]);
      } else if (margin_ > 0 || !kTrustsApart || !(verdicts.apart >> i & 1)) {
        if (decide(keys[i], i, &contacts[i])) addMet(keys[i], contacts[i]);
      }
    }
  }

  void getCorners(const std::uint64_t* keys, std::size_t count) {
    place();
    s_.pairs.count = count;
    for (std::size_t i = 0; i < count; ++i) {
      Corners p, q;
      for (int k = 0; k < 3; ++k) {
        p[k] = t1_.corner(first(keys[i]), k).template cast<double>();
        const Eigen::Vector3d own = t2_.corner(second(keys[i]), k).template cast<double>();
        q[k] = place_.linear() * own + place_.translation();
      }
      s_.pairs.put(i, p, q);
    }
  }

  // FCL's test, and what it leaves open: does the pair touch, whose corners are pair i of s_.pairs? Betters `contact`,
  // which is how the two are parted, or null where nobody asks.
  bool decide(std::uint64_t key, std::size_t i, query::ContactPoint* contact) {
    const std::uint32_t a = first(key), b = second(key);
    if (isCertain(key) && margin_ == 0) return true;
    Corners p, q;
    s_.pairs.get(i, p, q);
    if (margin_ > rounding()) return isWithinMargin(isCertain(key), p, q, contact);
    // Each in its own frame: where it is placed, rounding may give it a width.
    Corners own;
    for (int k = 0; k < 3; ++k) own[k] = t2_.corner(b, k).template cast<double>();
    const bool tiny = longest(p) * longest(own) < kSmallestProduct;
    const double width_q = query::relativeWidth(own);
    const bool is_sliver_q = tiny || isSliver(own, width_q);
    // Half of what counts as touching is left for what points on edges may be off by: the contact is as it was.
    const auto touchesByEdges = [&] {
      Eigen::Vector3d on_p, on_q;
      return margin_ == 0 && query::edgesTouch(p, q, rounding() / 2, on_p, on_q);
    };
    if (is_sliver_q && touchesByEdges()) return true;
    const double width_p = query::relativeWidth(p);
    const bool is_sliver_p = isSliver(p, width_p), sliver = !isCertain(key) && (is_sliver_q || is_sliver_p);
    if (!is_sliver_q && is_sliver_p && touchesByEdges()) return true;
    // FCL's axes do not separate segments and points from everything.
    const bool degenerate = sliver && (tiny || std::min(width_p, width_q) <= query::kDegenerate);
    const bool meet =
        isCertain(key) || (!degenerate && fcl::detail::Intersect<S>::intersect_Triangle(
                                              t1_.corner(a, 0), t1_.corner(a, 1), t1_.corner(a, 2), t2_.corner(b, 0),
                                              t2_.corner(b, 1), t2_.corner(b, 2), R_12_, p_12_));
    if (!sliver && margin_ == 0) return meet;
    // Of slivers, its axes are rounding, and may part what touches.
    const double touching = sliver ? rounding() : margin_;
    Eigen::Vector3d on_p, on_q;
    const double distance =
        query::nearestPoints(p, q, on_p, on_q, meet ? std::numeric_limits<double>::infinity() : touching);
    if (!meet && distance > touching) return false;
    if (contact != nullptr) setContact(distance, on_p, on_q, *contact);
    return true;
  }

  // FCL's test says nothing about what is apart by more than rounding, so distances alone decide.
  bool isWithinMargin(bool certain, const Corners& p, const Corners& q, query::ContactPoint* contact) const {
    Eigen::Vector3d on_p, on_q;
    const double distance =
        query::nearestPoints(p, q, on_p, on_q, certain ? std::numeric_limits<double>::infinity() : margin_);
    if (!certain && distance > margin_) return false;
    if (contact != nullptr) setContact(distance, on_p, on_q, *contact);
    return true;
  }

  // Where the two are apart, the contact is about their nearest points; else its depth is more by the margin.
  void setContact(double distance, const Eigen::Vector3d& on_p, const Eigen::Vector3d& on_q,
                  query::ContactPoint& contact) const {
    if (distance > rounding()) {
      contact = {(on_q - on_p) / distance, (on_p + on_q) / 2, std::max(margin_ - distance, 0.0)};
    } else {
      contact.depth += margin_;
    }
  }

  void addMet(std::uint64_t key, const query::ContactPoint& contact) {
    const std::uint32_t a = first(key), b = second(key);
    if (q_.request.enable_cost) addCost(a, b);
    Met met{0, a, b, {}};
    if (q_.request.enable_contact) {
      const fcl::Transform3<double> X_W1 = q_.X_W1.template cast<double>();
      met.contact = {X_W1.linear() * contact.normal, X_W1 * contact.point, contact.depth};
    }
    s_.met.push_back(met);
  }

  bool addSpheres(std::uint64_t cell, std::uint64_t id1, query::Sphere a, std::uint64_t id2, query::Sphere b) {
    q_.inCallersOrder(id1, id2);
    Met met{static_cast<double>(cell), id1, id2, {}};
    if (is_cut_ && !s_.first_cells.wants(met)) return false;
    q_.inCallersOrder(a, b);
    const fcl::Transform3<double> X_WA = q_.X_WA().template cast<double>();
    for (query::Sphere* s : {&a, &b}) {
      s->center = X_WA * Eigen::Vector3d(origin_ + unit_ * s->center);
      s->radius *= unit_;
    }
    if (q_.request.enable_cost) addCost(boxOf(a), boxOf(b));
    if (q_.request.enable_contact) {
      const Eigen::Vector3d displacement = b.center - a.center;
      const double distance = displacement.norm();
      if (distance > 0) met.contact.normal = displacement / distance;
      const double overlap = a.radius + b.radius - distance;  // negative: a gap, within the margin
      met.contact.depth = std::max(overlap + margin_, 0.0);
      met.contact.point = a.center + met.contact.normal * (a.radius - overlap / 2);
    }
    if (is_cut_) {
      s_.first_cells.add(met);
      if (s_.first_cells.isFull()) cut_.last_cell = static_cast<std::uint64_t>(s_.first_cells.last().place);
      return false;
    }
    s_.met.push_back(met);
    if (ends_at_first_) return emit();
    if (s_.met.size() >= most_) keepFirst();
    return false;
  }

  static fcl::AABB<S> boxOf(const query::Sphere& s) {
    const Eigen::Vector3d r = Eigen::Vector3d::Constant(s.radius);
    return fcl::AABB<S>((s.center - r).template cast<S>(), (s.center + r).template cast<S>());
  }

  void addCost(std::uint32_t a, std::uint32_t b) {
    addCost(fcl::AABB<S>(q_.X_W1 * t1_.corner(a, 0), q_.X_W1 * t1_.corner(a, 1), q_.X_W1 * t1_.corner(a, 2)),
            fcl::AABB<S>(q_.X_W2 * t2_.corner(b, 0), q_.X_W2 * t2_.corner(b, 1), q_.X_W2 * t2_.corner(b, 2)));
  }

  void addCost(const fcl::AABB<S>& a, const fcl::AABB<S>& b) {
    q_.addCost(a, b, q_.o1->cost_density * q_.o2->cost_density);
  }

  const CollideQuery<S>& q_;
  const ContactOrder order_;
  const Triangles<S>& t1_;
  const Triangles<S>& t2_;
  const double magnitude_;  // of positions in the frame of the first geometry
  const double margin_;
  const bool ends_at_first_;
  const std::size_t left_;  // contacts that are asked for
  const std::size_t most_;  // pairs to gather
  const bool is_cut_;
  Scratch& s_;
  query::Cut cut_;
  fcl::Transform3<double> place_ = fcl::Transform3<double>::Identity();     // the same in double
  fcl::Transform3<double> to_model_ = fcl::Transform3<double>::Identity();  // from the frame of the first geometry
  fcl::Matrix3<S> R_12_;
  fcl::Vector3<S> p_12_;
  bool placed_ = false;  // R_12_ and p_12_ are set
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double unit_ = 1, position_tolerance_ = 0;
};

/// What is within the margin touches: the walk's tolerance, in units of side A, is so much more. Positions may be off
/// by the tolerance before. `culling_margin`: the margin, or what CollideQuery::cullingMargin() has for slabs.
template <typename S>
SimilarityTransform withMargin(SimilarityTransform b_in_a, const TreeSide& a, const CollideQuery<S>& q,
                               double culling_margin) {
  const double per_unit = 1 / a.tree().surface().lattice.unit();
  b_in_a.margin = std::max(q.margin * per_unit - b_in_a.tolerance, 0.0);
  b_in_a.tolerance += culling_margin * per_unit;
  return b_in_a;
}

/// Are two meshes, and the spheres of their cells, apart because one of them is farther away than floats can say? Most
/// queries compare one number. What is beyond would overflow in a walk, or be lost in its tolerance.
template <typename S>
bool isOutOfSight(const CollideQuery<S>& q, const SimilarityTransform& b_in_a, double size_a, double size_b) {
  if (b_in_a.tolerance < 1e15) return false;
  const Eigen::Vector3d half_way =
      q.X_W1.translation().template cast<double>() / 2 - q.X_W2.translation().template cast<double>() / 2;
  return half_way.cwiseAbs().maxCoeff() > 8 * (size_a + size_b) + q.margin;
}

// Is a surface so long and thin that the float walk's rounding, which is a part of its length, is as wide as it is? The
// walk in double parts what that one cannot; of two such surfaces, along the axes of oriented boxes.
bool isNeedle(const tree::Tree& tree) {
  constexpr float kThin = 0x1p-12f;
  return tree.outline().read([](const tree::Outline::Reader& box) {
    const float x = box.half(0), y = box.half(1), z = box.half(2);
    const float most = std::max({x, y, z}), least = std::min({x, y, z}), middle = x + y + z - most - least;
    return middle < kThin * most;
  });
}

template <typename S>
void collideTrees(const CollideQuery<S>& q, const TreeSide& a, const TreeSide& b) {
  const std::size_t before = q.result.numContacts();
  tree::Tree &tree_a = a.tree(), &tree_b = b.tree();
  const auto [b_in_a, magnitude] = relate<S>(q, a, b);
  if (isOutOfSight(q, b_in_a, magnitudeOf(tree_a.surface().bounds), magnitudeOf(tree_b.surface().bounds))) return;
  const auto walk = [&, &b_in_a = b_in_a, magnitude = magnitude](auto&& with_collector) {
    const Triangles<S> t1(q.swapped ? tree_b : tree_a), t2(q.swapped ? tree_a : tree_b);
    Collector<S> collector(q, tree_a, t1, t2, magnitude);
    collector.setFrame(tree_a.surface().lattice, b_in_a.tolerance + q.margin / tree_a.surface().lattice.unit());
    with_collector(collector);
    collector.finish();
  };
  // TreeWalk widens slabs by itself; oriented boxes and spheres need no more than the margin.
  const SimilarityTransform near = withMargin(b_in_a, a, q, q.margin);
  // Not with float: FCL may see contacts of slivers that oriented boxes separate.
  constexpr bool kUsesBoxes = std::is_same<S, double>::value;
  const auto walkBoxes = [&](Collector<S>& collector) {
    const query::BoxSide boxes_a(a), boxes_b(b);
    query::PairWalk<query::BoxSide, query::BoxSide>(boxes_a, boxes_b, near, collector).run();
  };
  if (query::TreeWalk::fits(a, b, near) && !isNeedle(tree_a) && !isNeedle(tree_b)) {
    query::TreeWalk trees(a, b, near);
    if (!trees.isNeedless() && !(kUsesBoxes && query::knownBoxesApart(a, b, near))) {
      walk([&](auto& collector) {
        if (kUsesBoxes && collector.endsAtFirst()) {
          trees.runByTurns(collector);
        } else {
          trees.run(collector);
        }
      });
    }
  } else if (kUsesBoxes && isNeedle(tree_a) && isNeedle(tree_b) && query::BoxSide::fits(a, b)) {
    walk(walkBoxes);
  } else if (query::SphereWalk::fits(a, b)) {
    query::SphereWalk spheres(a, b, near);
    if (!spheres.isNeedless()) walk([&](auto& collector) { spheres.run(collector); });
  } else {
    const bool spheres = a.isConservative() || b.isConservative();
    const SimilarityTransform wide = withMargin(b_in_a, a, q, q.cullingMargin(spheres));
    walk([&](auto& collector) { query::PairWalk<TreeSide, TreeSide>(a, b, wide, collector).run(); });
  }
  if (q.mayBeInside(before) && (contains<S>(tree_a, q.X_WA(), tree_b, q.X_WB(), magnitude) ||
                                contains<S>(tree_b, q.X_WB(), tree_a, q.X_WA(), magnitude))) {
    addInside(q, a, b, b_in_a);
  }
}

template <typename S>
void collideBvh(const CollideQuery<S>& q, tree::Tree& tree, const BvhSide& b) {
  const std::size_t before = q.result.numContacts();
  const QueryScope scope(tree);
  const TreeSide& a = scope.a();
  const auto [b_in_a, magnitude] = relate<S>(q, a, b);
  const oracle::Surface& surface = tree.surface();
  if (isOutOfSight(q, b_in_a, magnitudeOf(surface.bounds), b.magnitude())) return;
  const Triangles<S> of_model(tree), of_partner(b);
  Collector<S> collector(q, tree, q.swapped ? of_partner : of_model, q.swapped ? of_model : of_partner, magnitude);
  collector.setFrame(surface.lattice, b_in_a.tolerance + q.margin / surface.lattice.unit());
  query::PairWalk<TreeSide, BvhSide>(a, b, withMargin(b_in_a, a, q, q.cullingMargin(a.isConservative())), collector)
      .run();
  collector.finish();
  if (q.mayBeInside(before) && contains<S>(tree, q.X_WA(), b, q.X_WB(), magnitude)) addInside(q, a, b, b_in_a);
}

/// The models among two geometries, of which one at least is one.
template <typename S>
struct Models {
  Models(const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2)
      : first(asModel<S>(o1)), second(asModel<S>(o2)) {
    if (first == nullptr && second == nullptr) {
      throw std::logic_error("bocst::collide: neither geometry is a bocst::Model");
    }
  }
  bool areTwo() const { return first != nullptr && second != nullptr; }
  const Model<S>*first, *second;
};

// Is the second to be side A? Without a choice, only where the first is no model.
template <typename S>
bool turnsRound(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2) {
  if (!models.areTwo()) return models.first == nullptr;
  return walksTurned(treeOf(*models.first), X_W1, treeOf(*models.second), X_W2);
}

// Are two models so far apart that nothing need be locked? For poses that are surely rigid. False where branches are
// due to be dropped, since only a query that holds the locks drops them, at its end.
template <typename S>
bool areFarApart(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2,
                 double margin) {
  static_assert(kSurelyRigidError <= 2e-5, "what query::areFarApart() allows for");
  const tree::Tree &tree1 = treeOf(*models.first), &tree2 = treeOf(*models.second);
  if (!query::areFarApart(tree1.outline(), X_W1.matrix().data(), tree2.outline(), X_W2.matrix().data(), margin)) {
    return false;
  }
  if (!tree1.hasDecay() && !tree2.hasDecay()) return true;
  // The system's clock need not be read twice.
  const std::int64_t now1 = tree1.now(), now2 = tree1.options().clock || tree2.options().clock ? tree2.now() : now1;
  return !(tree1.hasDecay() && tree1.isPruneDue(now1)) && !(tree2.hasDecay() && tree2.isPruneDue(now2));
}

template <typename S>
std::size_t answer(const CollideQuery<S>& q, const Models<S>& models, const BroughtSolver<S>& solver) {
  if (q.request.isSatisfied(q.result)) return q.result.numContacts();
  if (!q.occupied() && (q.o1->isFree() || q.o2->isFree() || !q.request.enable_cost)) return q.result.numContacts();
  const Model<S>*a = models.first, *b = models.second;
  q.inCallersOrder(a, b);
  if (b != nullptr) {
    const QueryScope scope(treeOf(*a), treeOf(*b));
    collideTrees(q, scope.a(), scope.b());
  } else if (isShape(q.b())) {
    collideShape(q, treeOf(*a), solver);
#if FCL_HAVE_OCTOMAP
  } else if (q.b()->getNodeType() == fcl::GEOM_OCTREE) {
    collideOcTree(q, treeOf(*a), solver);
#endif
  } else {
    collideBvh(q, treeOf(*a), bvhSideOf<S>("collide", q.b()));
  }
  return q.result.numContacts();
}

}  // namespace

template <typename S>
std::size_t collidePair(const fcl::CollisionGeometry<S>* o1, const fcl::Transform3<S>& X_W1,
                        const fcl::CollisionGeometry<S>* o2, const fcl::Transform3<S>& X_W2,
                        const BroughtSolver<S>& solver, const fcl::CollisionRequest<S>& request,
                        fcl::CollisionResult<S>& result, std::optional<double> margin) {
  const Models<S> models(o1, o2);
  const bool are_rigid = areSurelyRigid(X_W1, X_W2);
  if (!are_rigid) {
    checkPose("collide", "tf1", X_W1);
    checkPose("collide", "tf2", X_W2);
  }
  checkRequest(request);
  const double m = margin ? *margin : marginOf(models.first, models.second);
  // Most of a planner's pairs end here.
  if (are_rigid && models.areTwo() && areFarApart(models, X_W1, X_W2, m)) return result.numContacts();
  return answer(
      CollideQuery<S>{{o1, X_W1, o2, X_W2, turnsRound(models, X_W1, X_W2)}, request, result, m, margin.has_value()},
      models, solver);
}

namespace {

// Yes or no for two occupied models.
template <typename S>
bool touchAt(const Models<S>& models, const fcl::Transform3<S>& X_W1, const fcl::Transform3<S>& X_W2, double margin) {
  static const fcl::CollisionRequest<S> request;
  thread_local fcl::CollisionResult<S> result;
  result.clear();
  const CollideQuery<S> q{
      {models.first, X_W1, models.second, X_W2, turnsRound(models, X_W1, X_W2)}, request, result, margin};
  const QueryScope scope(treeOf(*models.first), treeOf(*models.second));
  collideTrees(q, q.swapped ? scope.b() : scope.a(), q.swapped ? scope.a() : scope.b());
  return result.isCollision();
}

}  // namespace

template <typename S>
bool touch(const Model<S>& a, const fcl::Transform3<S>& X_WA, const Model<S>& b, const fcl::Transform3<S>& X_WB) {
  return a.isOccupied() && b.isOccupied() && touchAt(Models<S>(&a, &b), X_WA, X_WB, marginOf(&a, &b));
}

template <typename S>
void collideRow(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                std::uint8_t* hit) {
  static const fcl::Transform3<S> identity = fcl::Transform3<S>::Identity();
  std::fill(hit, hit + count, std::uint8_t{0});
  if (!a.isOccupied() || !b.isOccupied()) return;
  const Models<S> models(&a, &b);
  const double margin = marginOf(&a, &b);
  // Of solids whose surfaces are apart, one may still be inside the other.
  const bool may_be_inside = treeOf(a).options().solid || treeOf(b).options().solid;
  const std::vector<Spheres>* spheres = nullptr;
  if (growsTogether(a, b)) {
    thread_local std::vector<PosedPair<S>> pairs;
    pairs.clear();
    for (std::size_t k = 0; k < count; ++k) pairs.push_back({&a, identity, &b, X_AB[k]});
    spheres = &growTogether(pairs);
  }
  for (std::size_t k = 0; k < count; ++k) {
    const Spheres found = spheres != nullptr ? (*spheres)[k] : Spheres::kUnknown;
    hit[k] = found == Spheres::kMeet;
    if (found == Spheres::kMeet || (found == Spheres::kApart && !may_be_inside)) continue;
    if (isSurelyRigid(X_AB[k]) && areFarApart(models, identity, X_AB[k], margin)) continue;
    hit[k] = touchAt(models, identity, X_AB[k], margin);
  }
}

#define BOCST_INSTANTIATE(S)                                                                                           \
  template void collideRow(const Model<S>&, const Model<S>&, const fcl::Transform3<S>*, std::size_t, std::uint8_t*);   \
  template bool touch(const Model<S>&, const fcl::Transform3<S>&, const Model<S>&, const fcl::Transform3<S>&);         \
  template std::size_t collidePair(const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const fcl::CollisionGeometry<S>*, const fcl::Transform3<S>&,                        \
                                   const BroughtSolver<S>&, const fcl::CollisionRequest<S>&, fcl::CollisionResult<S>&, \
                                   std::optional<double>);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::fcl_adapter
