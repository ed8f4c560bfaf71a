// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <utility>

// Include this after FCL's functions or bocst's overloads: the calls go to those that were declared before.

namespace bocst::program {
namespace {  // Each including file has its own: the same names mean other functions there.

struct FclCalls {
  template <typename... Arguments>
  static void collide(Arguments&&... arguments) {
    fcl::collide(std::forward<Arguments>(arguments)...);
  }
  template <typename... Arguments>
  static void distance(Arguments&&... arguments) {
    fcl::distance(std::forward<Arguments>(arguments)...);
  }
};

}  // namespace
}  // namespace bocst::program
