// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <string>
#include <vector>

#include "pairs/query_pair.h"

namespace bocst::program {

/// What of the meshes is beyond the limits within which exact answers are FCL's, as a sentence that ends with where
/// these are described (share/doc/guarantees.md, Limits): degenerate triangles, and with float coordinates above 1e9.
/// Empty if nothing is.
std::string beyondLimits(const std::vector<const Mesh*>& meshes, Scalar scalar);

}  // namespace bocst::program
