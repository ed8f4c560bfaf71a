// SPDX-License-Identifier: BSD-3-Clause
#include "fcl/adapters/models.h"

#include <cxxabi.h>

#include <cstdlib>
#include <memory>
#include <stdexcept>

namespace bocst::fcl_adapter {

std::string typeName(const std::type_info& type) {
  int status = 0;
  const std::unique_ptr<char, void (*)(void*)> name(abi::__cxa_demangle(type.name(), nullptr, nullptr, &status),
                                                    std::free);
  return status == 0 ? name.get() : type.name();
}

void refuseStaged(const char* query, const char* argument) {
  throw std::logic_error(std::string("bocst::") + query + ": " + argument +
                         " is a bocst::Model between beginModel() and endModel(); call endModel() first");
}

}  // namespace bocst::fcl_adapter
