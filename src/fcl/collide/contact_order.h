// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/triangle.h"
#include "oracle/oracle.h"
#include "query/sides/visitor.h"

namespace bocst::fcl_adapter {

/// Which of many contacts a request for few gets: the first by place, then by the ids. The place of two triangles is
/// the smallest coordinate of the segment in which they cut each other, along a direction near the longest axis of the
/// bounding box of the model's mesh, in the mesh's frame and length unit; where they do not clearly cut each other, the
/// largest coordinate of that triangle which ends first, so that a fine mesh has many places on a large triangle; with
/// a margin, the largest of the model's triangle, which needs no look at the other. The place of a triangle and a body
/// is the largest coordinate of that which ends first, of the body's box. That of a cell is its Morton code, which has
/// at most 48 bits. So the order is a property of mesh, pose and request, and a walk that wants the first few can leave
/// out what lies beyond: what touches does so in a point whose coordinate is no larger than the place. (Where both have
/// begun would not do: a node may have a part of a triangle alone, and they may touch in another.)
class ContactOrder {
 public:
  explicit ContactOrder(const tree::Tree& model) : surface_(model.surface()) {
    if (surface_.mesh == nullptr) return;
    int longest = 0;
    surface_.mesh->bounds().diagonal().maxCoeff(&longest);
    direction_[longest] = 1;
    // Parts have flat faces across that axis, in which all places would be the same.
    direction_[(longest + 1) % 3] = 0.31;
    direction_[(longest + 2) % 3] = 0.23;
  }

  /// Where triangle t of the model ends.
  double endOf(std::uint32_t t) const {
    const auto& i = surface_.mesh->indices(t);
    const auto at = [&](std::uint32_t v) { return direction_.dot(surface_.mesh->vertex(v)); };
    return std::max({at(i[0]), at(i[1]), at(i[2])});
  }

  /// Of a triangle and a body that ends at `greatest` in the lattice frame, see Cut::greatestOf().
  double placeOf(std::uint32_t t, double greatest) const {
    return std::min(endOf(t), surface_.lattice.unit() * greatest + direction_.dot(surface_.lattice.origin()));
  }

  /// Of two triangles, corners in any frame, from which `to_model` leads to the model's.
  double placeOf(const query::Corners& p, const query::Corners& q, const fcl::Transform3<double>& to_model) const {
    const Eigen::Vector3d direction = to_model.linear().transpose() * direction_;
    const auto place = query::nearEndOfCut(p, q, direction, kTolerance * surface_.lattice.unit());
    const auto end = [&](const query::Corners& t) {
      return std::max({direction.dot(t[0]), direction.dot(t[1]), direction.dot(t[2])});
    };
    return (place ? *place : std::min(end(p), end(q))) + direction_.dot(to_model.translation());
  }

  /// The cut of a walk in the model's lattice frame that has found nothing yet: it leaves nothing out.
  query::Cut startCut() const {
    query::Cut cut;
    cut.direction = direction_;
    return cut;
  }
  /// What lies beyond this place along the direction may be left out of the walk. Positions may be off by `tolerance`
  /// lattice units.
  void setCut(double place, double tolerance, query::Cut& cut) const {
    const lattice::Lattice& lattice = surface_.lattice;
    cut.last = (place - direction_.dot(lattice.origin())) / lattice.unit() + tolerance * direction_.lpNorm<1>();
  }

 private:
  static constexpr double kTolerance = 0x1p-8;  // lattice units: less than Cut::isBeyond() adds

  const oracle::Surface& surface_;
  Eigen::Vector3d direction_ = Eigen::Vector3d::UnitX();
};

/// The first items that a walk finds, a given number of them, in an order of contacts.
template <typename Item>
class FirstItems {
 public:
  void start(std::size_t count) {
    count_ = count;
    items_.clear();
  }
  bool isFull() const { return items_.size() == count_; }
  /// True if this item would be one of them.
  bool wants(const Item& item) const { return !isFull() || item < items_.front(); }
  void add(const Item& item) {
    if (isFull()) {
      std::pop_heap(items_.begin(), items_.end());
      items_.back() = item;
    } else {
      items_.push_back(item);
    }
    std::push_heap(items_.begin(), items_.end());
  }
  const Item& last() const { return items_.front(); }
  const std::vector<Item>& sort() {
    std::sort_heap(items_.begin(), items_.end());
    return items_;
  }

 private:
  std::size_t count_ = 0;
  std::vector<Item> items_;  // a heap: the last of them is at the front
};

}  // namespace bocst::fcl_adapter
