// SPDX-License-Identifier: BSD-3-Clause
#include "scene/world.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "fcl/adapters/validate.h"
#include "fcl/pair/grow_together.h"
#include "scene/reach.h"

namespace bocst::scene {
namespace {

std::uint64_t nextSerial() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

}  // namespace

// No entry of R^T R - I is larger, for a pose that is surely rigid: its eigenvalues are 2 e + e^2, sum e^2 follows from
// both sums (fcl_adapter::RigidSums, rigidStates()), and 4e-15 is what they may have lost by rounding.
constexpr double kErrorPerDeviation = 2.001;
inline double errorOf(double deviation) { return kErrorPerDeviation * std::sqrt((deviation + 4e-15) / 2); }
inline double deviationOf(double error) { return 2 * (error / kErrorPerDeviation) * (error / kErrorPerDeviation); }

template <typename S>
void checkPoses(const char* query, const fcl::Transform3<S>* X_WM, std::size_t states, std::size_t moving,
                std::vector<double>& orthogonality_errors, const char* state, std::size_t first) {
  orthogonality_errors.assign(roomFor(moving), 0);
  if (states == 0 || moving == 0) return;
  // Strings are made for what is refused, or nearly: queries allocate no memory.
  const auto name = [query] { return std::string("Scene::") + query; };
  if (X_WM == nullptr) throw std::invalid_argument("bocst::" + name() + ": the poses are null");
  static_assert(sizeof(fcl::Transform3<S>) == 16 * sizeof(S), "poses are rows of numbers");
  double* const deviations = orthogonality_errors.data();
  for (std::size_t k = 0;; ++k) {
    k += rigidStates(X_WM[k * moving].matrix().data(), states - k, moving, deviations);
    if (k == states) break;
    for (std::size_t i = 0; i < moving; ++i) {
      const fcl::Transform3<S>& X = X_WM[k * moving + i];
      if (!fcl_adapter::isSurelyRigid(X)) {
        const std::string where = state != nullptr ? state : "state " + std::to_string(first + k),
                          which = "the pose of moving object " + std::to_string(i) + " in " + where;
        fcl_adapter::checkPose(name().c_str(), which.c_str(), X);
      }
      deviations[i] = std::max(deviations[i], deviationOf(fcl_adapter::orthogonalityErrorOf<S>(X)));
    }
    if (k + 1 == states) break;
  }
  for (std::size_t i = 0; i < moving; ++i) orthogonality_errors[i] = errorOf(deviations[i]);
}

template <typename S>
double reachOf(const Bounds& b, double largest, double place, double displacement, double orthogonality_error) {
  const ReachFactors f = reachFactors<S>();
  return b.reach + f.per_place * (place + b.size) + f.per_error * orthogonality_error * (largest + b.size) +
         f.per_displacement * (displacement + b.radius) + f.least;
}

template <typename S>
double World<S>::reachWithin(const Object<S>& object, double place, double orthogonality_error) const {
  const Bounds& b = object.bounds;
  if (b.kind != Bounds::kBox) return 0;
  const double displacement = place + 2 * b.size + origin_.lpNorm<1>();
  return reachOf<S>(b, largest_, place, displacement, orthogonality_error) * (1 + 1e-12);
}

template <typename S>
Box World<S>::boxAt(const Object<S>& object, const fcl::Transform3<S>& X_WG, double orthogonality_error,
                    double reach) const {
  const Bounds& b = object.bounds;
  Box box;
  if (b.kind != Bounds::kBox) {
    const bool everywhere = b.kind == Bounds::kEverywhere;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) box.axis[k][j] = j == k;
      box.center[k] = 0;
      box.half[k] = everywhere ? 1e15f : 0;
      box.hi[k] = everywhere ? 1e30f : -std::numeric_limits<float>::infinity();
      box.lo[k] = -box.hi[k];
    }
    box.reach = 0;
    return box;
  }
  const Eigen::Matrix3d R = X_WG.linear().template cast<double>();
  const Eigen::Vector3d at = X_WG.translation().template cast<double>(), center = R * b.center + at - origin_;
  const double displacement = center.lpNorm<1>();
  if (reach == 0) reach = reachOf<S>(b, largest_, at.lpNorm<1>(), displacement, orthogonality_error);
  if (!(displacement + b.radius + reach < kUnboxedSize)) {
    Object<S> far;
    far.bounds.kind = Bounds::kEverywhere;
    return boxAt(far, X_WG, 0);
  }
  const Eigen::Matrix3d own = R * b.axes;
  const Eigen::Vector3d half = own.cwiseAbs() * b.half;  // along the world's axes
  const bool fine = orthogonality_error <= kFineError;
  const Eigen::Matrix3d axes = fine ? own : Eigen::Matrix3d::Identity();
  const Eigen::Vector3d along = fine ? b.half : half;
  box.reach = static_cast<float>(reach);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) box.axis[k][j] = static_cast<float>(axes(j, k));
    box.half[k] = static_cast<float>(along[k]);
    box.center[k] = static_cast<float>(center[k]);
    box.lo[k] = static_cast<float>(center[k] - half[k] - reach);
    box.hi[k] = static_cast<float>(center[k] + half[k] + reach);
  }
  return box;
}

// The parts of [begin, end) become the children of a node: halved, along the widest extent of their middles, until
// there are eight or each fits a group.
template <typename S>
std::int32_t World<S>::build(std::vector<std::uint32_t>& order, std::vector<std::pair<std::size_t, std::size_t>> parts,
                             const std::vector<Box>& boxes, const std::vector<Object<S>>& objects) {
  const auto size = [](const std::pair<std::size_t, std::size_t>& p) { return p.second - p.first; };
  while (parts.size() < 8) {
    const auto largest =
        std::max_element(parts.begin(), parts.end(), [&](const auto& p, const auto& q) { return size(p) < size(q); });
    if (size(*largest) <= 8) break;
    const auto [begin, end] = *largest;
    float lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
      lo[k] = hi[k] = boxes[order[begin]].center[k];
      for (std::size_t i = begin; i < end; ++i) {
        lo[k] = std::min(lo[k], boxes[order[i]].center[k]);
        hi[k] = std::max(hi[k], boxes[order[i]].center[k]);
      }
    }
    int k = 0;
    for (int j = 1; j < 3; ++j) k = hi[j] - lo[j] > hi[k] - lo[k] ? j : k;
    const std::size_t middle = begin + ((end - begin) / 2 + 7) / 8 * 8;
    std::nth_element(order.begin() + static_cast<std::ptrdiff_t>(begin),
                     order.begin() + static_cast<std::ptrdiff_t>(middle),
                     order.begin() + static_cast<std::ptrdiff_t>(end), [&](std::uint32_t p, std::uint32_t q) {
                       return std::pair(boxes[p].center[k], p) < std::pair(boxes[q].center[k], q);
                     });
    largest->second = middle;
    parts.emplace_back(middle, end);
  }
  const auto index = static_cast<std::int32_t>(nodes.size());
  nodes.emplace_back();
  BoxNode node;
  for (std::size_t lane = 0; lane < parts.size(); ++lane) {
    const auto [begin, end] = parts[lane];
    for (std::size_t i = begin; i < end; ++i) {
      for (int k = 0; k < 3; ++k) {
        node.lo[k][lane] = std::min(node.lo[k][lane], boxes[order[i]].lo[k]);
        node.hi[k][lane] = std::max(node.hi[k][lane], boxes[order[i]].hi[k]);
      }
    }
    if (end - begin > 8) {
      node.child[lane] = build(order, {{begin, end}}, boxes, objects);
    } else {
      node.child[lane] = ~static_cast<std::int32_t>(groups.size());
      BoxGroup group;
      for (std::size_t i = begin; i < end; ++i) {
        group.set(i - begin, boxes[order[i]]);
        fixed.push_back(objects[order[i]]);
      }
      groups.push_back(group);
      fixed.resize(8 * groups.size());
    }
  }
  nodes[static_cast<std::size_t>(index)] = node;
  return index;
}

namespace {

template <typename S>
double sizeOf(const Object<S>& o) {
  return o.bounds.kind == Bounds::kBox ? o.bounds.size : 0;
}

constexpr std::size_t kFewPlaces = 8;  // free ones that are compared for a new object

// The box along the world's axes around all lanes of a node or group.
template <typename Boxes>
void unite(const Boxes& boxes, float (&lo)[3], float (&hi)[3]) {
  for (int k = 0; k < 3; ++k) {
    lo[k] = *std::min_element(boxes.lo[k], boxes.lo[k] + 8);
    hi[k] = *std::max_element(boxes.hi[k], boxes.hi[k] + 8);
  }
}

}  // namespace

template <typename S>
World<S>::World(std::vector<Object<S>> moving_objects, const std::vector<Object<S>>& fixed_objects,
                const IgnoredPairs& ignored) {
  for (const Object<S>& o : moving_objects) largest_ = std::max(largest_, sizeOf(o));
  Eigen::AlignedBox3d middles;
  for (const Object<S>& o : fixed_objects) {
    largest_ = std::max(largest_, sizeOf(o));
    if (o.bounds.kind == Bounds::kBox) middles.extend(o.X_WG.template cast<double>() * o.bounds.center);
  }
  if (!middles.isEmpty()) origin_ = middles.center();

  // What is everywhere has a part of its own, what is nowhere none.
  std::vector<Box> boxes;
  std::vector<std::uint32_t> order;
  for (const bool everywhere : {true, false}) {
    for (std::uint32_t i = 0; i < fixed_objects.size(); ++i) {
      const Bounds::Kind kind = fixed_objects[i].bounds.kind;
      if (kind != Bounds::kNowhere && (kind == Bounds::kEverywhere) == everywhere) order.push_back(i);
    }
  }
  for (const Object<S>& o : fixed_objects) {
    const double orthogonality_error = fcl_adapter::orthogonalityErrorOf<S>(o.X_WG);
    fixed_error = std::max(fixed_error, orthogonality_error);
    grows_together |= o.grows_together;
    boxes.push_back(boxAt(o, o.X_WG, orthogonality_error));
  }
  const auto unbounded =
      static_cast<std::size_t>(std::count_if(fixed_objects.begin(), fixed_objects.end(),
                                             [](const Object<S>& o) { return o.bounds.kind == Bounds::kEverywhere; }));
  std::vector<std::pair<std::size_t, std::size_t>> parts;
  if (unbounded > 0) parts.emplace_back(0, unbounded);
  if (order.size() > unbounded) parts.emplace_back(unbounded, order.size());
  if (!parts.empty()) build(order, parts, boxes, fixed_objects);
  link();
  setMoving(std::move(moving_objects), ignored);
}

// Notes where everything is, and what is free.
template <typename S>
void World<S>::link() {
  slot_of_node_.resize(nodes.size());
  slot_of_group_.resize(groups.size());
  // Slots near the root are used first.
  for (std::size_t n = nodes.size(); n-- > 0;) {
    for (std::size_t lane = 0; lane < 8; ++lane) {
      const std::int32_t child = nodes[n].child[lane];
      if (child > 0) slot_of_node_[static_cast<std::size_t>(child)] = {n, lane};
      if (child < 0) slot_of_group_[static_cast<std::size_t>(~child)] = {n, lane};
      if (child == 0) free_slots_.push_back({n, lane});
    }
  }
  occupied_.assign(groups.size(), 0);
  for (std::size_t place = 0; place < fixed.size(); ++place) {
    if (fixed[place].geometry == nullptr) {
      free_places_.push_back(place);
    } else {
      place_of_[fixed[place].id] = place;
      occupied_[place / 8] |= static_cast<std::uint8_t>(1u << place % 8);
    }
  }
}

// Widens or narrows the boxes above a group.
template <typename S>
void World<S>::refit(std::size_t group) {
  float lo[3], hi[3];
  unite(groups[group], lo, hi);
  for (Slot slot = slot_of_group_[group];; slot = slot_of_node_[slot.node]) {
    BoxNode& node = nodes[slot.node];
    for (int k = 0; k < 3; ++k) {
      node.lo[k][slot.lane] = lo[k];
      node.hi[k][slot.lane] = hi[k];
    }
    if (slot.node == 0) return;
    unite(node, lo, hi);
  }
}

// A lane for one more object: of some that are free the one whose group grows the least.
template <typename S>
std::size_t World<S>::freePlace(const Box& box) {
  if (free_places_.empty()) addGroup();
  const auto growth = [&](std::size_t place) {
    float lo[3], hi[3], sum = 0;
    unite(groups[place / 8], lo, hi);
    for (int k = 0; k < 3; ++k) {
      const float before = std::max(hi[k] - lo[k], 0.0f);
      sum += std::max(hi[k], box.hi[k]) - std::min(lo[k], box.lo[k]) - before;
    }
    return sum;
  };
  const auto first = free_places_.size() > kFewPlaces ? free_places_.end() - kFewPlaces : free_places_.begin();
  const auto best =
      std::min_element(first, free_places_.end(), [&](std::size_t p, std::size_t q) { return growth(p) < growth(q); });
  std::swap(*best, free_places_.back());
  const std::size_t place = free_places_.back();
  free_places_.pop_back();
  return place;
}

template <typename S>
void World<S>::addGroup() {
  const auto addNode = [this](const BoxNode& node) {
    nodes.push_back(node);
    slot_of_node_.push_back({0, 0});
    return nodes.size() - 1;
  };
  if (free_slots_.empty()) {
    std::size_t first_free = 0;
    if (nodes.empty()) {
      addNode(BoxNode());
    } else {
      // The root moves down, below a new one in its place.
      const BoxNode root = nodes[0];
      const std::size_t below = addNode(root);
      for (std::size_t lane = 0; lane < 8; ++lane) {
        const std::int32_t child = root.child[lane];
        if (child > 0) slot_of_node_[static_cast<std::size_t>(child)].node = below;
        if (child < 0) slot_of_group_[static_cast<std::size_t>(~child)].node = below;
      }
      float lo[3], hi[3];
      unite(root, lo, hi);
      BoxNode above;
      above.child[0] = static_cast<std::int32_t>(below);
      for (int k = 0; k < 3; ++k) {
        above.lo[k][0] = lo[k];
        above.hi[k][0] = hi[k];
      }
      nodes[0] = above;
      first_free = 1;
    }
    for (std::size_t lane = first_free; lane < 8; ++lane) free_slots_.push_back({0, lane});
  }
  const Slot slot = free_slots_.back();
  free_slots_.pop_back();
  // The masks of moving groups come after those of fixed ones.
  const std::size_t before = allGroups(), fixed_before = fixedGroups();
  std::vector<std::uint8_t> more(moving.size() * (before + 1), 0);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    const std::uint8_t* from = masks.data() + i * before;
    std::uint8_t* to = more.data() + i * (before + 1);
    std::copy(from, from + fixed_before, to);
    std::copy(from + fixed_before, from + before, to + fixed_before + 1);
  }
  masks = std::move(more);
  nodes[slot.node].child[slot.lane] = ~static_cast<std::int32_t>(groups.size());
  slot_of_group_.push_back(slot);
  for (std::size_t lane = 8; lane-- > 0;) free_places_.push_back(8 * groups.size() + lane);
  groups.emplace_back();
  occupied_.push_back(0);
  fixed.resize(8 * groups.size());
}

template <typename S>
bool World<S>::putFixed(const Object<S>& object, const IgnoredPairs& ignored) {
  if (sizeOf(object) > largest_) return false;  // the reach of all boxes depends on it
  if (object.bounds.kind == Bounds::kNowhere) {
    removeFixed(object.id);
    return true;
  }
  ++changes_;
  const auto known = place_of_.find(object.id);
  const double orthogonality_error = fcl_adapter::orthogonalityErrorOf<S>(object.X_WG);
  const Box box = boxAt(object, object.X_WG, orthogonality_error);
  const std::size_t place = known != place_of_.end() ? known->second : freePlace(box);
  place_of_[object.id] = place;
  fixed[place] = object;
  occupied_[place / 8] |= static_cast<std::uint8_t>(1u << place % 8);
  fixed_error = std::max(fixed_error, orthogonality_error);
  grows_together |= object.grows_together;
  groups[place / 8].set(place % 8, box);
  refit(place / 8);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    setMask(i, place / 8, place % 8, !ignored.contains(moving[i].id, object.id));
  }
  return true;
}

template <typename S>
void World<S>::removeFixed(Id object) {
  const auto known = place_of_.find(object);
  if (known == place_of_.end()) return;
  ++changes_;
  const std::size_t place = known->second;
  free_places_.push_back(place);
  place_of_.erase(known);
  fixed[place] = Object<S>();
  occupied_[place / 8] &= static_cast<std::uint8_t>(~(1u << place % 8));
  groups[place / 8].clear(place % 8);
  refit(place / 8);
  for (std::size_t i = 0; i < moving.size(); ++i) setMask(i, place / 8, place % 8, false);
}

template <typename S>
void World<S>::releaseMoving(Id object) {
  const auto place = moving_of_.find(object);
  if (place != moving_of_.end()) moving[place->second].geometry = nullptr;
}

template <typename S>
bool World<S>::setMoving(std::vector<Object<S>> objects, const IgnoredPairs& ignored) {
  for (const Object<S>& o : objects) {
    if (sizeOf(o) > largest_) return false;
    grows_together |= o.grows_together;
  }
  moving = std::move(objects);
  serial = nextSerial();
  std::vector<Bounds> bounds;
  moving_of_.clear();
  for (std::size_t i = 0; i < moving.size(); ++i) {
    bounds.push_back(moving[i].bounds);
    moving_of_[moving[i].id] = i;
  }
  rows = rowsOf(bounds);
  fillMasks(ignored);
  return true;
}

template <typename S>
void World<S>::fillMasks(const IgnoredPairs& ignored) {
  std::vector<std::uint8_t> all = occupied_;
  all.resize(allGroups(), 0);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    if (moving[i].bounds.kind == Bounds::kNowhere) continue;
    all[fixedGroups() + i / 8] |= static_cast<std::uint8_t>(1u << i % 8);
  }
  masks.assign(moving.size() * allGroups(), 0);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    // Of moving objects, those that come later.
    std::uint8_t& own = all[fixedGroups() + i / 8];
    own &= static_cast<std::uint8_t>(~(1u << i % 8));
    if (moving[i].bounds.kind == Bounds::kNowhere) continue;
    std::copy(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(fixedGroups()), &masks[i * allGroups()]);
    std::copy(all.begin() + static_cast<std::ptrdiff_t>(fixedGroups() + i / 8), all.end(),
              &masks[i * allGroups() + fixedGroups() + i / 8]);
  }
  for (std::size_t i = 0; i < moving.size(); ++i) {
    for (const Id other : ignored.of(moving[i].id)) {
      // Of two moving objects, each has the other; the first one has the lane.
      const auto moves = moving_of_.find(other);
      if (moves != moving_of_.end() && moves->second > i) {
        setMask(i, fixedGroups() + moves->second / 8, moves->second % 8, false);
      } else if (moves == moving_of_.end()) {
        setIgnored(moving[i].id, other, true);
      }
    }
  }
}

// Makes a lane a pair with a moving object, or not.
template <typename S>
void World<S>::setMask(std::size_t moving_index, std::size_t group, std::size_t lane, bool is_pair) {
  std::uint8_t& mask = masks[moving_index * allGroups() + group];
  const auto bit = static_cast<std::uint8_t>(1u << lane);
  const bool is_somewhere = moving[moving_index].bounds.kind != Bounds::kNowhere;
  mask = static_cast<std::uint8_t>(is_pair && is_somewhere ? mask | bit : mask & ~bit);
}

template <typename S>
void World<S>::setIgnored(Id a, Id b, bool ignored) {
  const auto moving_a = moving_of_.find(a), moving_b = moving_of_.find(b);
  if (moving_a != moving_of_.end() && moving_b != moving_of_.end()) {
    const std::size_t first = std::min(moving_a->second, moving_b->second),
                      second = std::max(moving_a->second, moving_b->second);
    const bool is_somewhere = moving[second].bounds.kind != Bounds::kNowhere;
    setMask(first, fixedGroups() + second / 8, second % 8, !ignored && is_somewhere);
    return;
  }
  const auto moves = moving_a != moving_of_.end() ? moving_a : moving_b;
  const auto place = place_of_.find(moves == moving_a ? b : a);
  if (moves == moving_of_.end() || place == place_of_.end()) return;  // of two fixed objects, or of one that is nowhere
  setMask(moves->second, place->second / 8, place->second % 8, !ignored);
}

template <typename S>
void World<S>::place(const fcl::Transform3<S>* X_WM, const double* orthogonality_errors, const double* reach,
                     BoxGroup* boxes, std::uint32_t* others) const {
  if (moving.empty()) return;
  const Placing placing{orthogonality_errors, reach, {origin_[0], origin_[1], origin_[2]}, largest_};
  const std::size_t count = placeBoxes(X_WM->matrix().data(), rows, placing, boxes, others);
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t i = others[n];
    boxes[i / 8].set(i % 8, boxAt(moving[i], X_WM[i], orthogonality_errors[i], reach[i]));
  }
}

#define BOCST_INSTANTIATE(S)                                                                                          \
  template class World<S>;                                                                                            \
  template void checkPoses<S>(const char*, const fcl::Transform3<S>*, std::size_t, std::size_t, std::vector<double>&, \
                              const char*, std::size_t);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
