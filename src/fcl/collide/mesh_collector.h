// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/detail/traversal/collision/intersect.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <type_traits>
#include <vector>

#include "fcl/adapters/pair.h"
#include "fcl/collide/collide_query.h"
#include "fcl/collide/contact_order.h"
#include "fcl/collide/triangles.h"
#include "geometry/triangle.h"
#include "query/leaf/pair_set.h"
#include "query/sides/visitor.h"
#include "thread/of_thread.h"

namespace bocst::fcl_adapter {

/// A contact before it is one of FCL's: ids in the caller's order, and how the two touch, in the world.
struct Met {
  double place;  // of cells where few are chosen, see ContactOrder; else 0
  std::uint64_t b1, b2;
  query::ContactPoint contact;

  bool operator<(const Met& other) const { return std::tie(place, b1, b2) < std::tie(other.place, other.b1, other.b2); }
};

/// A pair of triangles and its place in the order of contacts.
struct RankedPair {
  double place;
  std::uint64_t key;

  bool operator<(const RankedPair& other) const { return place != other.place ? place < other.place : key < other.key; }
};

/// Turns the pairs of a walk into contacts and cost sources; triangles are those of the caller's first and second
/// geometry.
///
/// A walk finds pairs in an order that depends on what is resident. So unless any pair will do, contacts are sorted by
/// their ids. If there may be more than are asked for, few are chosen by ContactOrder, which lets the walk be cut at
/// the place of the last of them; many are the first by their ids of all that are gathered.
template <typename S>
class MeshCollector : public query::Visitor {
 public:
  /// `magnitude`: of positions in the frame of either mesh. `position_tolerance`: by how many lattice units of side A
  /// they may be off, the margin included.
  MeshCollector(const CollideQuery<S>& q, const tree::Tree& a, const Triangles<S>& of_a, const Triangles<S>& of_b,
                double magnitude, double position_tolerance)
      : q_(q),
        order_(a),
        t1_(q.swapped ? of_b : of_a),
        t2_(q.swapped ? of_a : of_b),
        lattice_(a.surface().lattice),
        magnitude_(magnitude),
        position_tolerance_(position_tolerance),
        margin_(q.margin),
        left_(q.contactsLeft()),
        most_(std::max<std::size_t>(kMost, left_ < kUnlimited ? 4 * left_ : kUnlimited)),
        mode_(startMode()),
        s_(scratch()),
        cut_(order_.startCut()) {
    s_.met.clear();
    if (mode_ == Mode::kAny) return;
    s_.seen.clear();
    s_.seen_cells.clear();
    s_.found.clear();
    if (wantsFew()) {
      s_.first.start(left_);
      s_.first_cells.start(left_);
      cut_.cell_side = q.swapped ? 1 : 0;
    }
  }

  bool endsAtFirst() const override { return mode_ == Mode::kAny; }
  const query::Cut* cut() const override { return wantsFew() ? &cut_ : nullptr; }

  /// From here on the first contacts are taken, leaves by leaves, and in leaves those of the smallest ids.
  void beginInOrder() { mode_ = Mode::kInOrder; }
  /// `gave_up`: what came is forgotten, and another walk begins.
  void endInOrder(bool gave_up) {
    if (!gave_up) return;
    mode_ = startMode();
    s_.found.clear();  // finish() replaces what was tested
  }

  bool triangles(std::uint32_t a, std::uint32_t b, bool certain) override {
    q_.inCallersOrder(a, b);
    const std::uint64_t key = keyOf(a, b, certain);
    switch (mode_) {
      case Mode::kAny:
        return endsWith(key);
      case Mode::kInOrder:
        s_.found.push_back(key);
        return false;
      case Mode::kFirst:
        addFirst(key);
        return false;
      case Mode::kFew:
      case Mode::kAll:
        break;
    }
    if (!s_.seen.insert(a, b)) return false;
    s_.found.push_back(key);
    if (mode_ == Mode::kFew && s_.found.size() > left_) rankFound();
    if (s_.found.size() >= most_) decideFound();
    return false;
  }

  bool endLeaves() override {
    if (s_.found.empty()) return false;
    decideEach();
    s_.found.clear();
    if (s_.met.size() < left_) return false;
    s_.met.resize(left_);
    return true;
  }

  bool cells(const query::CellLeaf& a, const query::CellLeaf& b) override {
    return addSpheres(q_.swapped ? b.id : a.id, a.id, a.sphere, b.id, b.sphere);
  }

  bool cellOfA(const query::CellLeaf& a, std::uint32_t b, const Eigen::Vector3d& point) override {
    if (mode_ != Mode::kAny && !s_.seen_cells.insert(a.id, b)) return false;
    return addSpheres(a.id, a.id, a.sphere, b, {point, 0});
  }

  bool cellOfB(std::uint32_t a, const query::CellLeaf& b, const Eigen::Vector3d& point) override {
    if (mode_ != Mode::kAny && !s_.seen_cells.insert(b.id, a)) return false;
    return addSpheres(b.id, a, {point, 0}, b.id, b.sphere);
  }

  /// To be called at the end of the walk.
  void finish() {
    if (mode_ == Mode::kAny) return;
    s_.seen.clear();
    s_.seen_cells.clear();
    if (mode_ == Mode::kFew || mode_ == Mode::kFirst) {
      for (const RankedPair& pair : s_.first.sort()) s_.found.push_back(pair.key);
      s_.met = s_.first_cells.sort();
    }
    decideFound();
    std::sort(s_.met.begin(), s_.met.end(),
              [](const Met& x, const Met& y) { return std::tie(x.b1, x.b2) < std::tie(y.b1, y.b2); });
    emit();
    freeIfLarge(s_.met);
    freeIfLarge(s_.found);
  }

 private:
  /// What is done with a pair of triangles that a walk finds.
  enum class Mode {
    kAny,      ///< Ends the walk, if it touches: any pair will do.
    kAll,      ///< Is gathered.
    kFew,      ///< Is gathered, while there are no more than are asked for; then kFirst.
    kFirst,    ///< Is kept, if it is one of the first by ContactOrder so far.
    kInOrder,  ///< Is one of the first, as the walk is in order.
  };

  Mode startMode() const {
    if (q_.endsAtFirst()) return Mode::kAny;
    if (!q_.wantsFew()) return Mode::kAll;
    constexpr std::size_t kNearlyAlwaysMore = 16;
    return left_ < kNearlyAlwaysMore ? Mode::kFirst : Mode::kFew;
  }
  bool wantsFew() const { return mode_ != Mode::kAny && mode_ != Mode::kAll; }

  static constexpr double kEpsilon = static_cast<double>(std::numeric_limits<S>::epsilon());
  // In float, FCL's axes between slivers' all but parallel edges are dominated by rounding, and it may say that they
  // meet.
  static constexpr bool kTrustsApart = std::is_same<S, double>::value;
  // When this many pairs are gathered, those beyond the number wanted are dropped.
  static constexpr std::size_t kMost = std::size_t{1} << 16, kUnlimited = std::size_t{1} << 40;

  // Orders pairs by their ids; triangle ids of the first geometry have at most 31 bits.
  static std::uint64_t keyOf(std::uint32_t a, std::uint32_t b, bool certain) {
    return std::uint64_t{a} << 33 | std::uint64_t{b} << 1 | std::uint64_t{!certain};
  }
  static std::uint32_t first(std::uint64_t key) { return static_cast<std::uint32_t>(key >> 33); }
  static std::uint32_t second(std::uint64_t key) { return static_cast<std::uint32_t>(key >> 1); }
  static bool isCertain(std::uint64_t key) { return (key & 1) == 0; }

  using FirstPairs = FirstItems<RankedPair>;
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
  static Scratch& scratch() { return thread::ofThread<Scratch>(); }
  template <typename T>
  static void freeIfLarge(std::vector<T>& v) {
    if (v.capacity() > kMost) std::vector<T>().swap(v);
  }

  // A triangle so narrow, of its length or of its corners' coordinates, is a segment or a point but for rounding in S.
  static constexpr double kNarrow = std::is_same<S, double>::value ? 1e-14 : 45 * kEpsilon;
  static double longest(const query::Corners& t) {
    return std::max((t[1] - t[0]).cwiseAbs().maxCoeff(), (t[2] - t[0]).cwiseAbs().maxCoeff());
  }
  static bool isSliver(const query::Corners& t, double relative_width) {
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

  // Any pair that touches will do: adds this one if it touches. True if nothing more is asked for.
  bool endsWith(std::uint64_t key) {
    if (!isCertain(key)) {
      getCorners(&key, 1);
      if (!decide(key, 0, nullptr)) return false;
    }
    return q_.addContact(first(key), second(key), nullptr);
  }

  // Only the first pairs that touch, a given number of them, are wanted: adds this one if it is one so far.
  void addFirst(std::uint64_t key) {
    const std::uint32_t of_model = q_.swapped ? second(key) : first(key);
    if (margin_ > 0 && !s_.first.wants({order_.endOf(of_model), key})) return;
    getCorners(&key, 1);
    const RankedPair pair{placeOf(of_model), key};
    // Most are not wanted, so only the others are remembered.
    if (!s_.first.wants(pair) || !s_.seen.insert(first(key), second(key)) || !decide(key, 0, nullptr)) return;
    s_.first.add(pair);
    if (s_.first.isFull()) order_.setCut(s_.first.last().place, position_tolerance_, cut_);
  }

  // Of the pair whose corners were got last.
  double placeOf(std::uint32_t of_model) const {
    if (margin_ > 0) return order_.endOf(of_model);
    query::Corners p, q;
    s_.pairs.get(0, p, q);
    return order_.placeOf(p, q, to_model_);
  }

  // There may be more than are wanted: from here on, by their places.
  void rankFound() {
    mode_ = Mode::kFirst;
    s_.seen.clear();
    for (const std::uint64_t key : s_.found) addFirst(key);
    s_.found.clear();
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
  void decideFound() {
    decideEach();
    s_.found.clear();
    keepFirst();
  }

  // Adds what was found and touches to `met`, in the order of ids, until there are enough.
  void decideEach() {
    constexpr std::size_t kBatch = query::TrianglePairs::kCapacity;
    std::vector<std::uint64_t>& found = s_.found;
    sortFound();
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
  }

  // In order, ids of the walk's side A come first, so that which are first does not depend on the caller's order.
  void sortFound() {
    std::vector<std::uint64_t>& found = s_.found;
    if (mode_ != Mode::kInOrder || !q_.swapped) return std::sort(found.begin(), found.end());
    std::sort(found.begin(), found.end(), [](std::uint64_t x, std::uint64_t y) {
      return keyOf(second(x), first(x), isCertain(x)) < keyOf(second(y), first(y), isCertain(y));
    });
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
      query::Corners q = t2_.corners(second(keys[i]));
      for (Eigen::Vector3d& corner : q) corner = place_.linear() * corner + place_.translation();
      s_.pairs.put(i, t1_.corners(first(keys[i])), q);
    }
  }

  // True if the pair whose corners are pair i of s_.pairs touches: by FCL's test, and by ours where that leaves it
  // open. Improves *contact, the pair's penetration; null: not wanted.
  bool decide(std::uint64_t key, std::size_t i, query::ContactPoint* contact) {
    const std::uint32_t a = first(key), b = second(key);
    if (isCertain(key) && margin_ == 0) return true;
    query::Corners p, q;
    s_.pairs.get(i, p, q);
    // FCL's test says nothing about what is apart by more than rounding, so distances alone decide.
    if (margin_ > rounding()) return isWithin(margin_, isCertain(key), p, q, contact);
    // Each in its own frame: where it is placed, rounding may give it a width.
    const query::Corners own = t2_.corners(b);
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
    return isWithin(sliver ? rounding() : margin_, meet, p, q, contact);
  }

  // True if two triangles meet, or are no farther apart than `touching`. Improves *contact unless that is null.
  bool isWithin(double touching, bool meet, const query::Corners& p, const query::Corners& q,
                query::ContactPoint* contact) const {
    Eigen::Vector3d on_p, on_q;
    const double distance =
        query::nearestPoints(p, q, on_p, on_q, meet ? std::numeric_limits<double>::infinity() : touching);
    if (!meet && distance > touching) return false;
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
    Met met{wantsFew() ? static_cast<double>(cell) : 0, id1, id2, {}};
    if (wantsFew() && !s_.first_cells.wants(met)) return false;
    q_.inCallersOrder(a, b);
    const fcl::Transform3<double> X_WA = q_.X_WA().template cast<double>();
    for (query::Sphere* s : {&a, &b}) {
      s->center = X_WA * Eigen::Vector3d(lattice_.origin() + lattice_.unit() * s->center);
      s->radius *= lattice_.unit();
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
    if (wantsFew()) {
      s_.first_cells.add(met);
      if (s_.first_cells.isFull()) cut_.last_cell = static_cast<std::uint64_t>(s_.first_cells.last().place);
      return false;
    }
    s_.met.push_back(met);
    if (mode_ == Mode::kAny) return emit();
    if (s_.met.size() >= most_) keepFirst();
    return false;
  }

  static fcl::AABB<S> boxOf(const query::Sphere& s) {
    const Eigen::Vector3d r = Eigen::Vector3d::Constant(s.radius);
    return fcl::AABB<S>((s.center - r).template cast<S>(), (s.center + r).template cast<S>());
  }

  void addCost(std::uint32_t a, std::uint32_t b) { addCost(t1_.box(a, q_.X_W1), t2_.box(b, q_.X_W2)); }

  void addCost(const fcl::AABB<S>& a, const fcl::AABB<S>& b) {
    q_.addCost(a, b, q_.o1->cost_density * q_.o2->cost_density);
  }

  const CollideQuery<S>& q_;
  const ContactOrder order_;
  const Triangles<S>& t1_;
  const Triangles<S>& t2_;
  const lattice::Lattice& lattice_;
  const double magnitude_, position_tolerance_, margin_;
  const std::size_t left_;  // contacts that are asked for
  const std::size_t most_;  // pairs to gather
  Mode mode_;
  Scratch& s_;
  query::Cut cut_;
  fcl::Transform3<double> place_ = fcl::Transform3<double>::Identity();     // the same in double
  fcl::Transform3<double> to_model_ = fcl::Transform3<double>::Identity();  // from the frame of the first geometry
  fcl::Matrix3<S> R_12_;
  fcl::Vector3<S> p_12_;
  bool placed_ = false;  // R_12_ and p_12_ are set
};

}  // namespace bocst::fcl_adapter
