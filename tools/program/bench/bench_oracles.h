// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "cli/report.h"

namespace bocst::program {

/// `bench --oracles`: every oracle of this machine on one mesh in several sizes.
struct OracleBench {
  std::string file;
  std::vector<std::size_t> sizes{5000, 75000, 1000000, 10000000};  ///< Triangles; the mesh is subdivided to get near.
  std::size_t pose_count = 1000;                                   ///< Of one call of collidePoses.
  double limit_seconds = 20;  ///< An oracle whose growth of the tree takes longer than this is left out from there on.

  int run(const Output& output) const;
};

}  // namespace bocst::program
