// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/thread.h"
#include "oracle/oracle.h"

namespace bocst::oracle::gl {

constexpr std::size_t kWord = sizeof(std::uint32_t);  ///< Bytes of a word of device memory.

/// Words of device memory, for triangle lists or for meshes: one buffer, parts of which are taken and come back when
/// nobody holds them.
class Arena : public std::enable_shared_from_this<Arena> {
 public:
  /// Words of the arena; they come back to it at the end.
  class Range : public DeviceResource {
   public:
    Range(std::shared_ptr<Arena> arena, std::uint32_t begin, std::uint32_t words)
        : arena_(std::move(arena)), begin_(begin), words_(words) {}
    ~Range() override;

    std::size_t bytes() const override { return words_ * kWord; }
    std::uint32_t begin() const { return begin_; }
    std::uint32_t words() const { return words_; }
    /// Gives back what is beyond the first `words`.
    void trim(std::uint32_t words);

   private:
    std::shared_ptr<Arena> arena_;
    std::uint32_t begin_, words_;
  };

  /// In the thread of the context, as all but ~Range.
  Arena(std::shared_ptr<Thread> thread, std::size_t most_bytes);
  ~Arena();

  /// @throws OracleError when the arena would be too large for the device.
  std::shared_ptr<Range> take(std::uint64_t words);
  /// Takes as many and writes them. @throws OracleError also when they do not arrive.
  std::shared_ptr<Range> upload(const std::vector<std::uint32_t>& words);
  /// Words to the host. @throws OracleError when the context is lost.
  void read(std::uint32_t begin, std::size_t words, std::uint32_t* to);

  Buffer& buffer() { return *buffer_; }

 private:
  void giveBack(std::uint32_t begin, std::uint32_t words);
  void read(const Buffer& from, std::uint64_t begin, std::size_t words, std::uint32_t* to);
  void grow(std::uint64_t words);

  const std::shared_ptr<Thread> thread_;
  const std::uint64_t most_words_;
  std::unique_ptr<Buffer> buffer_;
  std::unique_ptr<Staging> staging_;
  std::mutex mutex_;                             // of what follows
  std::map<std::uint32_t, std::uint32_t> free_;  // begin -> words
};

}  // namespace bocst::oracle::gl
