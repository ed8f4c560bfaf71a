// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/arena.h"
#include "oracle/gl/device_mesh.h"
#include "oracle/gl/layout.h"

namespace bocst::oracle::gl {

/// The programs and tables of one compute chain (layout.h). In the thread of the context.
class ComputeChain {
 public:
  /// What one chain may hold; tests make it small.
  struct Limits {
    std::uint64_t pairs = std::uint64_t{1} << 26;
    std::size_t cells = std::size_t{1} << 17;
    std::size_t bytes = 0;  ///< Of one buffer; 0: what the driver says.
    /// In a batch of at most this many pairs, each octant of a pair has a lane of its own; empty: as suits the device.
    std::optional<std::uint64_t> few_pairs;
  };

  /// @throws OracleError when a shader does not compile or the driver's limits are below what the chain needs.
  ComputeChain(Limits limits, Arena& arena);

  /// True if this question, with its mesh on the device, fits into a chain at all.
  bool fits(const ExpansionRequest& request) const;

  /// How many of the questions, from the first on, fit into one chain; at least one.
  std::size_t part(const std::vector<ExpansionRequest*>& requests, std::size_t first) const;

  /// Answers them all. @throws OracleError; the context is lost then if the device left something out.
  void answer(const std::vector<ExpansionRequest*>& requests, Thread& thread);

  /// Where the time of the last batch went; batches are timed from the first call on.
  const Oracle::Cost& cost() {
    is_timed_ = true;
    return cost_;
  }

  /// What the driver gets, by name of the pass.
  static std::vector<std::pair<std::string, std::string>> sources();

 private:
  enum Pass { kMasks, kDecide, kPlace, kFill, kNormals, kSlabs, kPack, kPasses };
  static_assert(kPasses == layout::kPassCount);

  /// A program and where its uniforms are; -1 for those that it does not have.
  struct Step {
    std::unique_ptr<Program> program;
    GLint items, lanes, cell_count, list_capacity, id_capacity, batch;
  };

  void reserve(Buffer& buffer, std::size_t words) const;
  void describe(const std::vector<ExpansionRequest*>& requests);
  void upload();
  void clearAnswers();
  void run(Pass pass, std::uint64_t items, std::uint32_t lanes = 1);
  void fill();
  const std::uint32_t* read(std::size_t words, Thread& thread);
  void checkHeader(const std::uint32_t* answers, Thread& thread) const;
  void take(const std::vector<ExpansionRequest*>& requests, const std::uint32_t* answers, Thread& thread) const;
  void findCost(std::chrono::duration<double> all);

  const Limits limits_;
  Arena& arena_;
  std::vector<Step> steps_;
  Buffer cells_, states_, masks_, answers_;
  Staging staging_;
  GLuint meshes_ = 0;  // the buffer that has all meshes
  std::uint32_t batch_ = 0;
  std::vector<layout::Cell> rows_;
  std::vector<std::uint32_t> ids_;     // of lists that are uploaded
  std::vector<std::uint32_t> sums_;    // of each cell's ids, as layout::kIds; 0 where the host does not know them
  std::vector<bool> is_uploaded_;      // each cell's list
  std::vector<std::uint32_t> checks_;  // of each cell, in 4 bytes: its row is no longer in the cache
  std::shared_ptr<Arena::Range> uploaded_, placed_;
  std::uint64_t pairs_ = 0, list_capacity_ = 0, id_capacity_ = 0;
  std::array<std::uint32_t, kPasses> groups_{};  // that are to run, since answers_ was cleared
  bool is_timed_ = false;
  Queries times_;
  Oracle::Cost cost_;
};

}  // namespace bocst::oracle::gl
