// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "query/sides/visitor.h"
#include "tree/tree.h"

namespace bocst::fcl_adapter {

/// The order of contacts: by place, then by the ids. The place of a triangle of a model is the largest coordinate of
/// its corners along the longest axis of its mesh's bounding box, in the mesh's frame and length unit; that of a cell
/// is its Morton code, which has at most 48 bits. So the order is a property of mesh, pose and request, and a walk that
/// wants the first few can leave out what lies beyond.
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

  /// Triangle t is about to be asked for, and now its corners.
  void prefetch(std::uint32_t t) const { __builtin_prefetch(&surface_.mesh->indices(t)); }
  void prefetchCorners(std::uint32_t t) const {
    for (const std::uint32_t v : surface_.mesh->indices(t)) __builtin_prefetch(&surface_.mesh->vertex(v)[axis_]);
  }

  /// The cut of a walk in the model's lattice frame that has found nothing yet: it leaves nothing out.
  query::Cut startCut() const {
    query::Cut cut;
    cut.axis = axis_;
    return cut;
  }
  /// Nodes whose triangles all lie at places after this one may be left out of the walk.
  void setCut(double place, query::Cut& cut) const {
    const lattice::Lattice& lattice = surface_.lattice;
    cut.last = (place - lattice.origin()[axis_]) / lattice.unit();
  }

 private:
  const oracle::Surface& surface_;
  int axis_ = 0;
};

/// The first so many of what a walk finds, in an order of contacts.
template <typename Item>
class FirstItems {
 public:
  /// More than these are rather gathered and sorted.
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
