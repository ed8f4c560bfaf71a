// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "query/cull/separation.h"
#include "query/sides/side.h"

namespace bocst::query {

/// Makes the supports of both trees exact in some of the directions that areSeparate() interpolated between; a few of
/// them each time.
void refineSupports(const TreeSide& a, const TreeSide& b, const NearDirections& near);

}  // namespace bocst::query
