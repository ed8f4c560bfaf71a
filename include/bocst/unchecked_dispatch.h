// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/export.h>

namespace bocst {

/// While one lives, a Model that this thread makes does not check that FCL's queries of this process reach bocst (see
/// setDispatchCheck()). For a module that is loaded in any order, as those of Python are, and all of whose queries
/// include <bocst/fcl.h>: it must give its models to nobody else.
class BOCST_EXPORT UncheckedDispatch {
 public:
  UncheckedDispatch();
  ~UncheckedDispatch();
  UncheckedDispatch(const UncheckedDispatch&) = delete;
  UncheckedDispatch& operator=(const UncheckedDispatch&) = delete;
};

}  // namespace bocst
