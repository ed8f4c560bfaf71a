// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/model.h>
#include <fcl/geometry/collision_geometry.h>

#include <stdexcept>
#include <string>
#include <typeinfo>

namespace bocst::fcl_adapter {

/// asModel() where the geometry's class is not Model itself.
template <typename S>
__attribute__((noinline)) const Model<S>* asDerivedModel(const fcl::CollisionGeometry<S>* geometry) {
  return geometry->getNodeType() == fcl::GEOM_TRIANGLE ? dynamic_cast<const Model<S>*>(geometry) : nullptr;
}

/// The geometry as the Model that it is, else null.
template <typename S>
const Model<S>* asModel(const fcl::CollisionGeometry<S>* geometry) {
  if (geometry == nullptr) return nullptr;
  // A dynamic_cast takes longer than a query of what is far apart; only classes made of Model need it.
  if (&typeid(*geometry) == &typeid(Model<S>)) return static_cast<const Model<S>*>(geometry);
  return asDerivedModel<S>(geometry);
}

struct ModelTree {
  template <typename S>
  static tree::Tree* of(const Model<S>& model) {
    return model.tree_.get();
  }
  template <typename S>
  static bool isStaged(const Model<S>& model) {
    return model.staged_ != nullptr;
  }
};

/// @throws std::logic_error: `argument` of a query is a Model between beginModel() and endModel().
[[noreturn]] void refuseStaged(const char* query, const char* argument);

/// The tree of a model. @throws std::logic_error for an empty one.
template <typename S>
tree::Tree& treeOf(const Model<S>& model) {
  tree::Tree* const tree = ModelTree::of(model);
  if (tree == nullptr && model.empty()) throw std::logic_error("bocst::Model: the model is empty");
  return *tree;
}

enum class PairKind {
  kForeign,  ///< Neither is a Model.
  kNothing,  ///< An empty Model is among them: nothing touches it.
  kModel,
};

/// @throws std::logic_error for a Model that is being built, std::invalid_argument for null.
template <typename S>
PairKind kindOf(const char* query, const fcl::CollisionGeometry<S>* o1, const fcl::CollisionGeometry<S>* o2) {
  const Model<S>*model1 = asModel<S>(o1), *model2 = asModel<S>(o2);
  if (model1 == nullptr || model2 == nullptr) {
    if (o1 == nullptr || o2 == nullptr) {
      throw std::invalid_argument(std::string("bocst::") + query + ": " + (o1 == nullptr ? "o1" : "o2") +
                                  " is a null pointer");
    }
    if (model1 == model2) return PairKind::kForeign;
  }
  const auto is_empty = [query](const Model<S>* model, const char* argument) {
    if (model == nullptr || ModelTree::of(*model) != nullptr) return false;
    if (ModelTree::isStaged(*model)) refuseStaged(query, argument);
    return true;
  };
  return is_empty(model1, "o1") || is_empty(model2, "o2") ? PairKind::kNothing : PairKind::kModel;
}

/// The C++ name of a type, for messages.
std::string typeName(const std::type_info& type);

/// The C++ name of the geometry's class, for messages.
template <typename S>
std::string typeName(const fcl::CollisionGeometry<S>* geometry) {
  return geometry != nullptr ? typeName(typeid(*geometry)) : "null";
}

}  // namespace bocst::fcl_adapter
