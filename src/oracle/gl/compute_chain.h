// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/arena.h"
#include "oracle/gl/device_mesh.h"

namespace bocst::oracle::gl {

/// The programs and tables of one compute chain (layout.h). In the thread of the context.
class ComputeChain {
 public:
  /// What one chain may hold; tests make it small.
  struct Limits {
    std::uint64_t pairs = std::uint64_t{1} << 26;
    std::size_t cells = std::size_t{1} << 17;
    std::size_t bytes = 0;  ///< Of one buffer; 0: what the driver says.
  };

  /// @throws OracleError when a shader does not compile or the driver's limits are below what the chain needs.
  ComputeChain(Limits limits, Arena& arena);

  /// Does this question, with its mesh on the device, fit into a chain at all?
  bool fits(const ExpansionRequest& request) const;

  /// How many of the questions, from the first on, fit into one chain; at least one.
  std::size_t part(const std::vector<ExpansionRequest*>& requests, std::size_t first) const;

  /// Answers them all; questions about one mesh follow each other. @throws OracleError
  void answer(const std::vector<ExpansionRequest*>& requests, Thread& thread);

  const Oracle::Cost& cost() const { return cost_; }

 private:
  // As in the shaders.
  struct Cell {
    float center[3];
    float half_side;
    std::uint32_t first_pair, list, exists, ids_up_to;
  };
  struct Range {
    const DeviceMesh* mesh;
    std::uint32_t cell_begin, cell_end, pair_begin, pair_end;
  };
  enum Pass { kMasks, kDecide, kPlace, kFill, kNormals, kSlabs, kPack, kPasses };

  /// A program and where its uniforms are; -1 for those that it does not have.
  struct Step {
    std::unique_ptr<Program> program;
    GLint pairs, cells, cell_count, list_capacity, id_capacity;
  };

  void reserve(Buffer& buffer, std::size_t words) const;
  void upload(const std::vector<ExpansionRequest*>& requests);
  void dispatch(Pass pass, std::uint64_t invocations) const;
  void dispatchPairs(Pass pass) const;
  void placeAndFill();
  void readBack(const std::vector<ExpansionRequest*>& requests);

  const Limits limits_;
  Arena& arena_;
  std::vector<Step> steps_;
  Buffer cells_, states_, masks_, answers_;
  std::vector<Cell> rows_;
  std::vector<Range> ranges_;
  std::vector<std::uint32_t> words_;  // of the answer
  std::shared_ptr<Arena::Range> uploaded_, placed_;
  std::uint64_t list_capacity_ = 0, id_capacity_ = 0;
  Queries times_;
  Oracle::Cost cost_;
};

}  // namespace bocst::oracle::gl
