// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "arguments.h"
#include "page.h"
#include "poses.h"
#include "query_pair.h"

namespace bocst::program {

/// Two meshes with what one query for contacts, at most `limit`, grew in two fresh models.
Page pairPage(const std::string& file_a, const Mesh& mesh_a, const std::string& file_b, const Mesh& mesh_b,
              const ModelArguments& model, const Pose& pose, std::size_t limit,
              const std::vector<std::pair<std::string, std::string>>& facts);

}  // namespace bocst::program
