// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "picture/page.h"
#include "scene/ask_scene.h"

namespace bocst::program {

/// The parts in each state, with those that collide.
Page scenePage(const std::string& file, const SceneSetup& setup, const Bodies& bodies, const SceneAnswers& answers);

}  // namespace bocst::program
