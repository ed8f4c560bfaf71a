// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "picture/grown_pair.h"
#include "picture/page.h"

namespace bocst::program {

Page pairPage(const GrownPair& grown);

}  // namespace bocst::program
