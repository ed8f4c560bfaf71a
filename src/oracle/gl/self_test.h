// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "oracle/gl/compute_oracle.h"
#include "oracle/gl/occlusion_oracle.h"

namespace bocst::oracle::gl {

/// Asks a device what the CPU knows: two meshes in a batch, lists that are uploaded and lists that stay there, lists
/// longer than their room, cells of the deepest levels. Says what was wrong first; empty when all is right. A driver
/// that fails it would make surface vanish from queries.
std::string selfTest(ComputeOracle& oracle);
std::string selfTest(OcclusionOracle& oracle);

/// The same with walks over two trees.
std::string selfTestOfWalks(ComputeOracle& oracle);

}  // namespace bocst::oracle::gl
