// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
#include <memory>

namespace bocst::program {

/// Each triangle into four, by the middles of its edges. The surface stays the same up to rounding.
std::shared_ptr<const Mesh> subdivided(const Mesh& mesh);

/// As often as told; the mesh itself for 0.
std::shared_ptr<const Mesh> subdivided(std::shared_ptr<const Mesh> mesh, std::size_t times);

}  // namespace bocst::program
