// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/arena.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <string>

namespace bocst::oracle::gl {
namespace {

constexpr std::uint64_t kFirstWords = 1 << 16;
constexpr std::size_t kSample = 64;  // words

}  // namespace

Arena::Range::~Range() { arena_->giveBack(begin_, words_); }

void Arena::Range::trim(std::uint32_t words) {
  if (words >= words_) return;
  arena_->giveBack(begin_ + words, words_ - words);
  words_ = words;
}

Arena::Arena(std::shared_ptr<Thread> thread, std::size_t most_bytes)
    : thread_(std::move(thread)),
      most_words_(std::min<std::uint64_t>(most_bytes / kWord, std::numeric_limits<std::int32_t>::max())),
      buffer_(std::make_unique<Buffer>()) {}

Arena::~Arena() {
  thread_->post([b = buffer_.release()] { delete b; });
}

std::shared_ptr<Arena::Range> Arena::take(std::uint64_t words) {
  for (;;) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (auto it = free_.begin(); it != free_.end(); ++it) {
        const auto [begin, size] = *it;
        if (size < words) continue;
        free_.erase(it);
        if (size > words)
          free_.emplace(begin + static_cast<std::uint32_t>(words), size - static_cast<std::uint32_t>(words));
        return std::make_shared<Range>(shared_from_this(), begin, static_cast<std::uint32_t>(words));
      }
    }
    grow(words);
  }
}

std::shared_ptr<Arena::Range> Arena::upload(const std::vector<std::uint32_t>& words) {
  std::shared_ptr<Range> range = take(words.size());
  const std::size_t at = range->begin() * kWord, bytes = words.size() * kWord;
  buffer_->write(at, bytes, words.data());
  thread_->require(buffer_->holds(at, bytes, words.data()), "a mesh did not arrive");
  return range;
}

void Arena::grow(std::uint64_t words) {
  const std::uint64_t before = buffer_->bytes() / kWord;
  if (before + words > most_words_) {
    throw OracleError(std::to_string((before + words) * kWord) + " bytes are more than the device takes in one buffer");
  }
  const std::uint64_t after = std::min(most_words_, std::max({kFirstWords, 2 * before, before + words}));
  auto larger = std::make_unique<Buffer>();
  larger->reserve(after * kWord);
  if (before > 0) {
    glBindBuffer(GL_COPY_READ_BUFFER, buffer_->name());
    glBindBuffer(GL_COPY_WRITE_BUFFER, larger->name());
    glCopyBufferSubData(GL_COPY_READ_BUFFER, GL_COPY_WRITE_BUFFER, 0, 0, static_cast<GLsizeiptr>(before * kWord));
    // A few words show whether it was done.
    std::uint32_t sample[kSample];
    for (const std::uint64_t at : {std::uint64_t{0}, before / 2, before - kSample}) {
      buffer_->read(at * kWord, sizeof(sample), sample);
      thread_->require(larger->holds(at * kWord, sizeof(sample), sample), "a copy did not arrive");
    }
  }
  buffer_ = std::move(larger);
  giveBack(static_cast<std::uint32_t>(before), static_cast<std::uint32_t>(after - before));
}

void Arena::giveBack(std::uint32_t begin, std::uint32_t words) {
  if (words == 0 || thread_->isForked()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  auto it = free_.emplace(begin, words).first;
  if (const auto next = std::next(it); next != free_.end() && it->first + it->second == next->first) {
    it->second += next->second;
    free_.erase(next);
  }
  if (it == free_.begin()) return;
  if (const auto last = std::prev(it); last->first + last->second == it->first) {
    last->second += it->second;
    free_.erase(it);
  }
}

}  // namespace bocst::oracle::gl
