// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <fcl/narrowphase/collision_request.h>
#include <fcl/narrowphase/collision_result.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "fcl/pair/ordered_pair.h"
#include "geometry/triangle.h"
#include "query/cull/separation.h"

namespace bocst::fcl_adapter {

/// The caller's question about a collision, in the caller's order.
template <typename S>
struct CollideQuery : OrderedPair<S> {
  const fcl::CollisionRequest<S>& request;
  fcl::CollisionResult<S>& result;
  double margin;                                ///< Surfaces no farther apart than this touch.
  bool is_distance = false;                     ///< Only the margin counts, and not the tolerance of FCL's solvers.
  query::Hulls hulls = query::Hulls::kUnknown;  ///< Of two models; they may have changed since.

  /// Only between occupied geometries are there contacts.
  bool occupied() const { return this->o1->isOccupied() && this->o2->isOccupied(); }

  /// By how much culling must be wider for the margin: slabs are measured along normals up to a hundredth too long.
  double cullingMargin(bool spheres) const { return margin * (spheres ? 1 : 1.02); }

  /// No surfaces met, and a contact would be reported.
  bool mayBeInside(std::size_t contacts_before) const {
    return result.numContacts() == contacts_before && contacts_before < request.num_max_contacts && occupied();
  }

  /// How many contacts are still asked for.
  std::size_t contactsLeft() const {
    return request.num_max_contacts - std::min(request.num_max_contacts, result.numContacts());
  }

  /// Yes or no: any pair that touches will do, so which one it is may depend on what is resident. All other questions
  /// get the same contacts always.
  bool endsAtFirst() const {
    return request.num_max_contacts == 1 && !request.enable_contact && !request.enable_cost && occupied();
  }

  /// Requests for more gather all contacts, and get the first by the ids.
  static constexpr std::size_t kMostOfFew = 1024;
  /// Few contacts, of which there may be more: the walk need not find all.
  bool wantsFew() const {
    return !endsAtFirst() && contactsLeft() > 0 && contactsLeft() <= kMostOfFew && !request.enable_cost;
  }

  /// So few of them may be those that a walk in order finds first.
  bool mayTakeInOrder() const {
    constexpr std::size_t kMostContacts = 256;
    return wantsFew() && contactsLeft() <= kMostContacts;
  }
  /// After so many pairs of leaves such a walk gives up: `few` are enough unless surfaces hardly touch, or margins are
  /// large, with which contacts by position take milliseconds.
  std::size_t mostLeafPairs(std::size_t few) const { return (margin > 0 ? 2048 : few) + contactsLeft(); }

  /// Adds a contact if there is room; `contact` (world frame) may be null where contacts are not enabled. True when
  /// nothing more is asked for.
  bool addContact(std::intptr_t b1, std::intptr_t b2, const query::ContactPoint* contact) const {
    if (occupied() && result.numContacts() < request.num_max_contacts) {
      fcl::Contact<S> c;
      c.o1 = this->o1;
      c.o2 = this->o2;
      c.b1 = b1;
      c.b2 = b2;
      if (request.enable_contact && contact != nullptr) {
        // Rotations may stretch it.
        c.normal = contact->normal.normalized().template cast<S>();
        c.pos = contact->point.template cast<S>();
        c.penetration_depth = static_cast<S>(contact->depth);
      } else {
        c.normal.setConstant(std::numeric_limits<S>::quiet_NaN());
        c.pos = c.normal;
        c.penetration_depth = std::numeric_limits<S>::quiet_NaN();
      }
      result.addContact(c);
    }
    return request.isSatisfied(result);
  }

  /// Adds the overlap of two world boxes as a cost source. What is apart, within the margin, shares no room.
  void addCost(const fcl::AABB<S>& a, const fcl::AABB<S>& b, S density) const {
    if (margin > 0 && !a.overlap(b)) return;
    fcl::AABB<S> overlap;
    overlap.min_ = a.min_.cwiseMax(b.min_);
    // Boxes of what touches overlap, but for rounding.
    overlap.max_ = a.max_.cwiseMin(b.max_).cwiseMax(overlap.min_);
    result.addCostSource(fcl::CostSource<S>(overlap, density), request.num_max_cost_sources);
  }
};

}  // namespace bocst::fcl_adapter
