// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "grown_pair.h"
#include "page.h"

namespace bocst::program {

Page pairPage(const GrownPair& grown);

}  // namespace bocst::program
