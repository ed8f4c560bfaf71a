// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/common/types.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/triangle.h"
#include "query/sides/visitor.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// Which of many contacts a request for few gets: the first by place, then by the ids. The place of two triangles is
/// the largest coordinate of the segment in which they cut each other, along the longest axis of the bounding box of
/// the model's mesh, in the mesh's frame and length unit; where they do not clearly cut each other, and beside bodies,
/// that of the corners of the model's triangle. The place of a cell is its Morton code, which has at most 48 bits. So
/// the order is a property of mesh, pose and request, and a walk that wants the first few can leave out what lies
/// beyond: where two triangles touch, no coordinate is larger than their place.
class ContactOrder {
 public:
  explicit ContactOrder(const tree::Tree& model) : surface_(model.surface()) {
    if (surface_.mesh != nullptr) surface_.mesh->bounds().diagonal().maxCoeff(&axis_);
  }

  double placeOf(std::uint32_t t) const {
    const auto& i = surface_.mesh->indices(t);
    return std::max(
        {surface_.mesh->vertex(i[0])[axis_], surface_.mesh->vertex(i[1])[axis_], surface_.mesh->vertex(i[2])[axis_]});
  }

  /// The same of triangle t and one of another mesh, corners in any frame, from which `to_model` leads to the model's.
  double placeOf(std::uint32_t t, const query::Corners& p, const query::Corners& q,
                 const fcl::Transform3<double>& to_model) const {
    const Eigen::Vector3d direction = to_model.linear().row(axis_);
    const auto place = query::farEndOfCut(p, q, direction, kTolerance * surface_.lattice.unit());
    return place ? *place + to_model.translation()[axis_] : placeOf(t);
  }

  /// The cut of a walk in the model's lattice frame that has found nothing yet: it leaves nothing out.
  query::Cut startCut() const {
    query::Cut cut;
    cut.axis = axis_;
    return cut;
  }
  /// What lies beyond this place along the axis may be left out of the walk. Positions may be off by `tolerance`
  /// lattice units.
  void setCut(double place, double tolerance, query::Cut& cut) const {
    const lattice::Lattice& lattice = surface_.lattice;
    cut.last = (place - lattice.origin()[axis_]) / lattice.unit() + tolerance;
  }

 private:
  static constexpr double kTolerance = 0x1p-8;  // lattice units: less than Cut::isBeyond() adds

  const oracle::Surface& surface_;
  int axis_ = 0;
};

/// The first items that a walk finds, a given number of them, in an order of contacts.
template <typename Item>
class FirstItems {
 public:
  /// Requests for more gather all contacts, and get the first by the ids.
  static constexpr std::size_t kMost = 1024;

  void start(std::size_t count) {
    count_ = count;
    items_.clear();
  }
  bool isFull() const { return items_.size() == count_; }
  /// Would this item be one of them?
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
