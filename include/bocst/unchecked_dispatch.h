// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

namespace bocst {

/// While such an object exists, a Model that this thread makes does not check that FCL's queries in this process reach
/// bocst (see setDispatchCheck()). For a module that is loaded in any order, as Python modules are, and whose queries
/// all include <bocst/fcl.h>. Such a module must not pass its models to other code.
class BOCST_EXPORT UncheckedDispatch {
 public:
  UncheckedDispatch();
  ~UncheckedDispatch();
  UncheckedDispatch(const UncheckedDispatch&) = delete;
  UncheckedDispatch& operator=(const UncheckedDispatch&) = delete;
};

}  // namespace bocst
