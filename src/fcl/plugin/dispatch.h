// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/collision_geometry.h>

#include <string>
#include <typeinfo>

namespace bocst::fcl_adapter {

/// Registers bocst in FCL's tables and asks, once a process and scalar, the entry points that code compiled without
/// <bocst/fcl.h> would call, on a sentinel pair: do they reach this library? Thread-safe; cheap from the second call
/// on.
/// @throws std::runtime_error with the remedy when they do not, each time, unless BOCST_DISPATCH_CHECK=off.
template <typename S>
void checkDispatch();

/// The geometry as the Model that it is, else null.
template <typename S>
const Model<S>* asModel(const fcl::CollisionGeometry<S>* geometry) {
  // A dynamic_cast takes longer than a query of what is far apart; only classes made of Model need it.
  if (geometry == nullptr || geometry->getNodeType() != fcl::GEOM_TRIANGLE) return nullptr;
  if (typeid(*geometry) == typeid(Model<S>)) return static_cast<const Model<S>*>(geometry);
  return dynamic_cast<const Model<S>*>(geometry);
}

/// The C++ name of the geometry's class, for messages.
template <typename S>
std::string typeName(const fcl::CollisionGeometry<S>* geometry);

}  // namespace bocst::fcl_adapter
