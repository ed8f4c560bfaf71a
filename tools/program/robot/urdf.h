// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "robot/mesh_store.h"
#include "robot/packages.h"
#include "robot/robot.h"
#include "robot/xml_file.h"

namespace bocst::program {

/// Reads a robot: its links' collision geometries (not the visual ones) and its joints.
/// @throws std::runtime_error that names the file and, where it is known, the line and the link or joint.
Robot readUrdf(const XmlFile& file, const Packages& packages, MeshStore& meshes);

}  // namespace bocst::program
