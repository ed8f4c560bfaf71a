// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "bench/bench_report.h"
#include "bench/bench_setting.h"

namespace bocst::program {

// The scenarios of `bench`: each adds its rows.

/// Two new models and one query, beside one streaming pass over both meshes.
void benchFirst(BenchSetting& setting, BenchReport& report);

/// Poses that are asked once, by windows, and totals from the arrays.
void benchFresh(BenchSetting& setting, BenchReport& report);

/// Meshes that cubes divide badly, whatever the files: build and queries beside FCL's.
void benchCliffs(BenchSetting& setting, BenchReport& report);

/// An arm among shelves and both meshes under FCL's broad phase: pairs one by one, states, modes.
void benchPlanner(BenchSetting& setting, BenchReport& report);

/// Yes-or-no queries, on poses that were asked until the trees stopped growing.
void benchWarm(BenchSetting& setting, BenchReport& report);

/// All contacts with their geometry, warm.
void benchContacts(BenchSetting& setting, BenchReport& report);

/// Distances of the poses that do not touch, warm, and of new models.
void benchDistance(BenchSetting& setting, BenchReport& report);

/// Bytes a triangle: of the trees, and all that the models hold.
void benchMemory(BenchSetting& setting, BenchReport& report);

/// Frames of one mesh that slides over the other.
void benchMoving(BenchSetting& setting, BenchReport& report);

/// Frames in which all vertices of A move, with ten queries each.
void benchDeforming(BenchSetting& setting, BenchReport& report);

/// Two threads on one pair of models.
void benchThreads(BenchSetting& setting, BenchReport& report);

/// A with itself at several sizes; FCL is not asked.
void benchGrowth(BenchSetting& setting, BenchReport& report);

}  // namespace bocst::program
