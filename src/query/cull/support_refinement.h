// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "query/cull/separation.h"
#include "query/sides/side.h"

namespace bocst::query {

/// Asks the trees how far their surfaces reach in the directions that a look was between, a few of them each time.
void refineSupports(const TreeSide& a, const TreeSide& b, const NearDirections& near);

}  // namespace bocst::query
