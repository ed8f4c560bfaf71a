// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>

namespace bocst {

/// How a cell is divided (paper, sections 4.2 and 4.3).
enum class Subdivision {
  kOctree,  ///< O-BOCST: the root is the centred bounding cube, every cell is halved.
  kBono,    ///< B-BOCST: branch-on-need; the lower side of every split is the largest exact power of two.
};

/// What a query answers.
enum class Answer {
  kExact,         ///< Triangle tests at the bottom: FCL's mesh-mesh answer.
  kConservative,  ///< The spheres of Options::depth, as in the paper: never misses, overestimates by the sphere size.
};

/// The backend that subdivides cells: it finds the octants that the surface meets.
enum class OracleKind {
  kAuto,       ///< BOCST_ORACLE where it is set; else the CPU, for conservative answers beside a GPU.
  kCpu,        ///< SIMD on the calling thread.
  kOcclusion,  ///< OpenGL 3.3: occlusion queries whose geometry shader tests exactly what the query is about.
  kCompute,    ///< OpenGL 4.3: compute shaders; triangle lists stay on the device.
  kSampled,    ///< The paper's occlusion queries as written (4.2). They miss surface, so answers may be false "free":
               ///< for comparison only.
};

/// The clock that ttl is measured with.
using Clock = std::chrono::steady_clock;

/// What only repeats experiments of the paper.
struct PaperOptions {
  /// Pixels a side of the views that kSampled draws, from 1 to 4096.
  int viewport = 16;

  /// The paper's level rule (5.3): with kBono and 2^n + 2 <= d_t < 2^n + 2^(n-1), n = nbits(d_t) - 1, the collision
  /// depth is one more than Options::depth.
  bool level_rule = false;
};

/// How a model grows, answers and forgets. Fixed when the model is made.
struct Options {
  Subdivision subdivision = Subdivision::kBono;  ///< How cells are divided.
  Answer answer = Answer::kExact;                ///< What a query answers.

  /// Collision depth: the level at which kConservative answers; the root is level 1. From 1 to 17.
  int depth = 6;

  /// The paper's d_t: the largest extent of the mesh in lattice units, from 1 to 65536; 0: 65536, the finest lattice.
  /// Only kBono's cells depend on it (4.4): its root cube has the smallest power of two that is >= d_t as its side.
  double dimension = 0;

  OracleKind oracle = OracleKind::kAuto;  ///< Who tests octants.

  /// The paper's Max. time (3.1): a deepest level unused for longer is dropped; 0: never.
  std::chrono::milliseconds ttl{2000};

  /// Bytes of resident tree to stay under, least recently used branches go first; 0: no limit. A running query may
  /// exceed it; what it grew is dropped when it ends.
  std::size_t memory_budget = 0;

  /// Surfaces no farther apart than this collide, 0 or more, in the mesh's length unit. Of two models, the sum of both
  /// margins counts. For collide() and continuousCollide(), and in the boxes that broadphase managers look at;
  /// distance() stays that of the surfaces.
  double margin = 0;

  /// The mesh also collides with what is wholly inside it, in both argument orders: with the other geometry, if a
  /// connected component of that is inside. A point is inside if its winding number is not zero: components may
  /// overlap, and one with the opposite orientation inside another is a cavity. The mesh must be watertight: each edge
  /// occurs as often in one direction as in the other (vertices at the same position count as one; triangles without
  /// area do not matter), else std::invalid_argument, also from updateVertices(). Costs a sort of the edges and 12 to
  /// 40 bytes a triangle.
  bool solid = false;

  /// One thread, which all models of the process share, builds the model's tree while its first queries run, instead of
  /// one of those queries that would take the time for it. Queries do not wait for that thread. For exact answers
  /// of models without a memory budget whose cells the CPU divides (kCpu, kAuto); other models take no notice.
  bool build_ahead = false;

  PaperOptions paper;  ///< For experiments.

  /// What queries read the time from; empty: Clock, as of the system's last tick (some milliseconds). Tests inject
  /// their own.
  std::function<Clock::time_point()> clock;
};

}  // namespace bocst
