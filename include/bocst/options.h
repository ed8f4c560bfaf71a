// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstddef>
#include <functional>

namespace bocst {

/// How a cell is divided (paper, sections 4.2 and 4.3).
enum class Subdivision {
  kOctree,  ///< O-BOCST: the root is the centred bounding cube; every cell is halved.
  kBono,    ///< B-BOCST: branch-on-need; the lower side of every split is the largest exact power of two.
};

/// How a query tests for contact.
enum class Answer {
  kExact,         ///< Triangle tests at the leaves: FCL's mesh-mesh answer.
  kConservative,  ///< Sphere tests at Options::depth, as in the paper. No contact is missed; surfaces that are apart by
                  ///< less than the diameters of two spheres, one of each model, may be reported as touching.
};

/// The backend that subdivides cells: it finds the octants that the surface meets.
enum class OracleKind {
  kAuto,       ///< BOCST_ORACLE if it is set; else the CPU, and for conservative answers also a GPU.
  kCpu,        ///< SIMD on the calling thread.
  kOcclusion,  ///< OpenGL 3.3: occlusion queries with an exact test in the geometry shader.
  kCompute,    ///< OpenGL 4.3: compute shaders; long triangle lists stay on the device.
  kSampled,    ///< The paper's occlusion queries as published (4.2). They can miss parts of the surface and so
               ///< give a false "free": for comparison only.
};

/// The clock that measures ttl.
using Clock = std::chrono::steady_clock;

/// Options that only serve to repeat experiments of the paper.
struct PaperOptions {
  /// Width and height in pixels of the views that kSampled draws, from 1 to 4096.
  int viewport = 16;

  /// The paper's level rule (5.3): with kBono and 2^n + 2 <= d_t < 2^n + 2^(n-1), n = nbits(d_t) - 1, the collision
  /// depth is one more than Options::depth.
  bool level_rule = false;
};

/// How a model expands its tree, answers queries and drops nodes. Fixed when the model is made.
struct Options {
  Subdivision subdivision = Subdivision::kBono;  ///< How cells are divided.
  Answer answer = Answer::kExact;                ///< What a query answers.

  /// Collision depth: the level of the spheres that kConservative tests; the root is level 1. From 1 to 17. Each level
  /// doubles the resolution. Where large faces are parallel and 1 to 4 cells of this level apart, it also takes four
  /// times the time and the memory of a query: two plates of two triangles 28 ms at depth 8 (2.4 ms when it is asked
  /// again) and 2 MB for their trees, 6 s and 1 GB at depth 12, whatever memory_budget says. Most uses need 4 to 9.
  int depth = 6;

  /// The paper's d_t: the largest extent of the mesh in units of the lattice, which divides each axis of the root cube
  /// into 65536 at most: from 1 to 65536; 0: 65536, the finest lattice.
  /// Only kBono's cells depend on it (4.4): the side of its root cube is the smallest power of two that is >= d_t.
  /// If it is not 0, conservative queries expand the nodes that the paper's do; else fewer, the verdicts being the
  /// same.
  double dimension = 0;

  OracleKind oracle = OracleKind::kAuto;  ///< Backend that subdivides cells.

  /// After this time without use, the deepest level of a branch is dropped; then the time of the level above starts.
  /// Later queries of this model or Model::prune() do this, no thread. 0: never. The paper's Max. time (3.1).
  std::chrono::milliseconds ttl{2000};

  /// Limit of the resident tree in bytes; the least recently used branches are dropped first; 0: no limit. A running
  /// query may exceed it, and expandAll() until a query walks the tree; then branches are dropped. With less than about
  /// 6 bytes per triangle of the mesh, many queries drop and grow large parts again and take milliseconds (a complete
  /// tree takes 16 to 25; with less than 1000 triangles up to 140). With any limit, requests for a few contacts take up
  /// to ten times as long, since they build no complete tree.
  std::size_t memory_budget = 0;

  /// Surfaces at a distance of at most this collide; 0 or more, in the mesh's length unit. Between two models, the sum
  /// of both margins counts. It applies to collide(), continuousCollide() and the bounding boxes for broadphase
  /// managers, not to distance(), which measures between the surfaces.
  double margin = 0;

  /// The mesh also collides with a geometry if a connected component of that geometry is completely inside the mesh, in
  /// both argument orders. A point is inside if its winding number is not zero: components may overlap, and one with
  /// the opposite orientation inside another is a cavity. The mesh must be watertight: each edge occurs equally often
  /// in both directions (vertices at the same position count as one; triangles with two corners at one position are
  /// ignored). Otherwise the constructor, setMesh() and updateVertices() throw std::invalid_argument. Costs a sort of
  /// the edges and 12 to 40 bytes per triangle.
  bool solid = false;

  /// A thread that all models of the process share builds the whole tree while the model's first queries run, and later
  /// the oriented boxes and the probes that queries need (share/doc/how-it-works.md). If false, one of those queries
  /// builds each of these and takes longer. A query still builds oriented boxes itself if it would take much longer
  /// without them. A query that expands nodes may wait for that thread some tens of microseconds. If the process forks
  /// while the thread builds a model, the child cannot query that model. No effect with conservative answers, with a
  /// memory budget, for more than 178 million triangles, or with an oracle other than kCpu and kAuto.
  bool build_ahead = false;

  PaperOptions paper;  ///< For experiments.

  /// Source of the time for ttl; empty: Clock, with the resolution of the system's tick (some milliseconds). Tests can
  /// set their own clock here. Queries call it from several threads at once, so it must be thread-safe, and must not
  /// call the model. If it jumps back, nothing is dropped until it has caught up.
  std::function<Clock::time_point()> clock;
};

}  // namespace bocst
