// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/collide_poses.h>
#include <bocst/dispatch_check.h>
#include <bocst/fcl.h>
#include <bocst/is_closer_than.h>
#include <bocst/log.h>
#include <bocst/mesh.h>
#include <bocst/model.h>
#include <bocst/node_view.h>
#include <bocst/options.h>
#include <bocst/oracle.h>
#include <bocst/scene.h>
#include <bocst/statistics.h>
