// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "egl/handles.h"
#include "oracle/device_walks.h"
#include "oracle/gl/arena.h"

namespace bocst::oracle::gl {

/// Walks pairs of sphere-trees at many poses (shaders/pairs.glsl): one dispatch and one read-back for all of them. In
/// the thread of the context.
class PairWalker {
 public:
  /// bytes: the most of one buffer. @throws OracleError when the shader does not compile.
  PairWalker(Arena& arena, std::size_t bytes);

  /// Brings a table of nodes to the device, after it has written its stamp into each block. @throws OracleError.
  std::shared_ptr<const DeviceResource> upload(std::vector<std::uint32_t>& words);

  /// Answers all. @throws OracleError; the context is lost then if the device left something out.
  void walk(DeviceWalks& walks, Thread& thread);

  /// What the driver gets.
  static std::string source();

 private:
  struct Table;

  void walkPart(DeviceWalks& walks, std::size_t first, std::size_t count, Thread& thread);
  void describe(const DeviceWalks& walks, std::size_t first, std::size_t count);
  void take(DeviceWalks& walks, std::size_t first, std::size_t count, const std::uint32_t* answers,
            Thread& thread) const;

  Arena& arena_;
  const std::size_t bytes_;
  const Program program_;
  Buffer pairs_, answers_;
  Staging staging_;
  std::uint32_t batch_ = 0, stamp_ = 0;
  std::vector<std::uint32_t> rows_, used_, wanted_;  // of the pairs; where each tree's bits go
  std::size_t answer_words_ = 0;
};

}  // namespace bocst::oracle::gl
