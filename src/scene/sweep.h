// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "fcl/pair/grow_together.h"
#include "scene/state_check.h"

namespace bocst::scene {

/// Looks at a row of states, where neighbours are often alike: the middle state of each part of the row says which
/// pairs can touch in none of its states, from how far objects move until its ends; the rest goes on to both halves.
template <typename S>
class Sweep {
 public:
  enum class Goal {
    kAny,    ///< The first that collides, middles before halves.
    kFirst,  ///< The least that collides.
    kAll,    ///< Each; written to hit[].
  };

  /// There are states and moving objects; hit[] is 0 before. `orthogonality_errors`: of the poses of each moving
  /// object, at least. Returns the index of the state that was looked for; `states` if there is none.
  std::size_t run(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, Goal goal,
                  std::uint8_t* hit, const std::vector<double>& orthogonality_errors);

  StateCheck<S>& check() { return check_; }

 private:
  struct Part {
    std::size_t begin, end;   // states
    std::size_t first, last;  // entries, if it has a list
    bool has_list;
  };

  void growForAll(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, std::uint8_t* hit);
  void measure(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states);
  bool setFar(const World<S>& world, const fcl::Transform3<S>* X_WM, std::size_t states, const Part& part,
              std::size_t middle);

  StateCheck<S> check_;
  std::vector<fcl_adapter::PosedPair<S>> pairs_;  // of growForAll()
  std::vector<std::size_t> state_of_pair_;        // likewise
  std::vector<double> path_, place_;              // see measurePaths()
  bool is_measured_ = false;
  std::size_t farthest_ = 0;  // the moving object that last moved too far
  std::vector<Part> parts_;
  std::vector<Entry> entries_, found_;
};

}  // namespace bocst::scene
