// SPDX-License-Identifier: BSD-3-Clause
#include "scene/world.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <sstream>
#include <stdexcept>
#include <string>

#include "fcl/adapters/validate.h"
#include "fcl/queries/grow_together.h"
#include "scene/reach.h"

namespace bocst::scene {
namespace {

template <typename S>
[[noreturn]] void refuse(const char* query, const std::string& which, const fcl::Transform3<S>& X) {
  std::ostringstream text;
  text << "bocst::Scene::" << query << ": the pose" << which << " is not rigid:\n" << X.matrix();
  throw std::invalid_argument(text.str());
}

std::uint64_t nextSerial() {
  static std::atomic<std::uint64_t> last{0};
  return ++last;
}

}  // namespace

template <typename S>
double orthogonalityErrorOf(const fcl::Transform3<S>& X) {
  const S* m = X.matrix().data();  // columns of four
  const double a0 = m[0], a1 = m[1], a2 = m[2], b0 = m[4], b1 = m[5], b2 = m[6], c0 = m[8], c1 = m[9], c2 = m[10];
  const double aa = a0 * a0 + a1 * a1 + a2 * a2, bb = b0 * b0 + b1 * b1 + b2 * b2, cc = c0 * c0 + c1 * c1 + c2 * c2;
  const double ab = a0 * b0 + a1 * b1 + a2 * b2, bc = b0 * c0 + b1 * c1 + b2 * c2, ca = c0 * a0 + c1 * a1 + c2 * a2;
  const double determinant = a0 * (b1 * c2 - b2 * c1) + a1 * (b2 * c0 - b0 * c2) + a2 * (b0 * c1 - b1 * c0);
  // x - x is 0, and NaN for what is not finite.
  const double nothing = (m[12] - m[12]) + (m[13] - m[13]) + (m[14] - m[14]);
  const double off = std::max(std::max(std::max(std::abs(aa - 1), std::abs(bb - 1)), std::abs(cc - 1)),
                              std::max(std::max(std::abs(ab), std::abs(bc)), std::abs(ca)));
  // std::max may lose a NaN; a sum does not.
  const bool finite = aa + bb + cc + nothing < std::numeric_limits<double>::infinity();
  return finite && determinant > 0 ? off : std::numeric_limits<double>::infinity();
}

// No entry of R^T R - 1 is larger, for a pose that is surely rigid: its eigenvalues are 2 e + e^2, sum e^2 follows from
// both sums (fcl_adapter::RigidSums, rigidStates()), and 4e-15 is what they may have lost by rounding.
constexpr double kErrorPerDeviation = 2.001;
inline double errorOf(double deviation) { return kErrorPerDeviation * std::sqrt((deviation + 4e-15) / 2); }
inline double deviationOf(double error) { return 2 * (error / kErrorPerDeviation) * (error / kErrorPerDeviation); }

template <typename S>
void refusePose(const char* query, const fcl::Transform3<S>* X_WM, std::size_t k, std::size_t moving,
                const char* state) {
  refuse<S>(query,
            " of moving object " + std::to_string(k % moving) + " in " +
                (state != nullptr ? state : "state " + std::to_string(k / moving)),
            X_WM[k]);
}

template <typename S>
void checkPoses(const char* query, const fcl::Transform3<S>* X_WM, std::size_t states, std::size_t moving,
                std::vector<double>& orthogonality_errors, const char* state) {
  orthogonality_errors.assign(roomFor(moving), 0);
  if (states == 0 || moving == 0) return;
  if (X_WM == nullptr) throw std::invalid_argument(std::string("bocst::Scene::") + query + ": the poses are null");
  static_assert(sizeof(fcl::Transform3<S>) == 16 * sizeof(S), "poses are rows of numbers");
  double* const deviations = orthogonality_errors.data();
  for (std::size_t k = 0;; ++k) {
    k += rigidStates(X_WM[k * moving].matrix().data(), states - k, moving, deviations);
    if (k == states) break;
    for (std::size_t i = 0; i < moving; ++i) {
      const double error = orthogonalityErrorOf<S>(X_WM[k * moving + i]);
      if (!(error <= fcl_adapter::kMaxOrthogonalityError)) refusePose<S>(query, X_WM, k * moving + i, moving, state);
      deviations[i] = std::max(deviations[i], deviationOf(error));
    }
    if (k + 1 == states) break;
  }
  for (std::size_t i = 0; i < moving; ++i) orthogonality_errors[i] = errorOf(deviations[i]);
}

template <typename S>
void checkPose(const char* query, const fcl::Transform3<S>& X) {
  if (!(orthogonalityErrorOf<S>(X) <= fcl_adapter::kMaxOrthogonalityError)) refuse<S>(query, "", X);
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
  for (std::size_t lane = 0; lane < 8; ++lane) {
    node.child[lane] = 0;
    for (int k = 0; k < 3; ++k) {
      node.lo[k][lane] = std::numeric_limits<float>::infinity();
      node.hi[k][lane] = -std::numeric_limits<float>::infinity();
    }
    if (lane >= parts.size()) continue;
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

template <typename S>
World<S>::World(std::vector<Object<S>> moving_objects, std::vector<Object<S>> fixed_objects,
                const std::set<std::pair<Id, Id>>& ignored_pairs)
    : moving(std::move(moving_objects)), serial(nextSerial()) {
  const auto ignored = [&](Id a, Id b) { return ignored_pairs.count(std::minmax(a, b)) != 0; };
  const auto sizeOf = [](const Object<S>& o) { return o.bounds.kind == Bounds::kBox ? o.bounds.size : 0; };
  for (const Object<S>& o : moving) largest_ = std::max(largest_, sizeOf(o));
  std::vector<Bounds> bounds;
  for (const Object<S>& o : moving) bounds.push_back(o.bounds);
  rows = rowsOf(bounds);
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
    const double orthogonality_error = orthogonalityErrorOf<S>(o.X_WG);
    fixed_error = std::max(fixed_error, orthogonality_error);
    boxes.push_back(boxAt(o, o.X_WG, orthogonality_error));
  }
  const auto unbounded =
      static_cast<std::size_t>(std::count_if(fixed_objects.begin(), fixed_objects.end(),
                                             [](const Object<S>& o) { return o.bounds.kind == Bounds::kEverywhere; }));
  std::vector<std::pair<std::size_t, std::size_t>> parts;
  if (unbounded > 0) parts.emplace_back(0, unbounded);
  if (order.size() > unbounded) parts.emplace_back(unbounded, order.size());
  if (!parts.empty()) build(order, parts, boxes, fixed_objects);

  const auto growsSlowly = [](const Object<S>& o) {
    return o.model != nullptr && fcl_adapter::growsTogether(*o.model, *o.model);
  };
  grows_together = std::any_of(moving.begin(), moving.end(), growsSlowly) ||
                   std::any_of(fixed_objects.begin(), fixed_objects.end(), growsSlowly);

  masks.assign(moving.size() * allGroups(), 0);
  for (std::size_t i = 0; i < moving.size(); ++i) {
    for (const Object<S>& o : fixed_objects) pair_count += !ignored(moving[i].id, o.id);
    for (std::size_t j = i + 1; j < moving.size(); ++j) pair_count += !ignored(moving[i].id, moving[j].id);
    if (moving[i].bounds.kind == Bounds::kNowhere) continue;
    for (std::size_t group = 0; group < allGroups(); ++group) {
      for (std::size_t lane = 0; lane < 8; ++lane) {
        if (!isFixed(group) && (movingIndex(group, lane) <= i || movingIndex(group, lane) >= moving.size())) continue;
        const Object<S>& o = object(group, lane);
        if (o.geometry == nullptr || o.bounds.kind == Bounds::kNowhere || ignored(moving[i].id, o.id)) continue;
        masks[i * allGroups() + group] |= static_cast<std::uint8_t>(1u << lane);
      }
    }
  }
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
  template double orthogonalityErrorOf<S>(const fcl::Transform3<S>&);                                                 \
  template void checkPoses<S>(const char*, const fcl::Transform3<S>*, std::size_t, std::size_t, std::vector<double>&, \
                              const char*);                                                                           \
  template void checkPose<S>(const char*, const fcl::Transform3<S>&);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst::scene
