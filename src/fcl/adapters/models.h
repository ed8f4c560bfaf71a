// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/collision_geometry.h>

#include <string>
#include <typeinfo>

namespace bocst::fcl_adapter {

/// The geometry as the Model that it is, else null.
template <typename S>
const Model<S>* asModel(const fcl::CollisionGeometry<S>* geometry) {
  // A dynamic_cast takes longer than a query of what is far apart; only classes made of Model need it.
  if (geometry == nullptr || geometry->getNodeType() != fcl::GEOM_TRIANGLE) return nullptr;
  if (typeid(*geometry) == typeid(Model<S>)) return static_cast<const Model<S>*>(geometry);
  return dynamic_cast<const Model<S>*>(geometry);
}

/// The C++ name of a type, for messages.
std::string typeName(const std::type_info& type);

/// The C++ name of the geometry's class, for messages.
template <typename S>
std::string typeName(const fcl::CollisionGeometry<S>* geometry) {
  return geometry != nullptr ? typeName(typeid(*geometry)) : "null";
}

}  // namespace bocst::fcl_adapter
