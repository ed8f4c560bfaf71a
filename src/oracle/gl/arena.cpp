// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/arena.h"

#include <algorithm>
#include <cstring>
#include <iterator>
#include <limits>
#include <new>
#include <string>

namespace bocst::oracle::gl {
namespace {

constexpr std::uint64_t kFirstWords = 1 << 16;
constexpr std::size_t kSample = 64;           // words
constexpr std::size_t kMostAtOnce = 1 << 20;  // words on their way to the host

}  // namespace

Arena::Range::~Range() {
  try {
    arena_->giveBack(begin_, words_);
  } catch (const std::bad_alloc&) {
    // These words are lost to the arena.
  }
}

void Arena::Range::trim(std::uint32_t words) {
  if (words >= words_) return;
  arena_->giveBack(begin_ + words, words_ - words);
  words_ = words;
}

Arena::Arena(std::shared_ptr<Thread> thread, std::size_t most_bytes)
    : thread_(std::move(thread)),
      most_words_(std::min<std::uint64_t>(most_bytes / kWord, std::numeric_limits<std::int32_t>::max())),
      buffer_(std::make_unique<Buffer>()),
      staging_(std::make_unique<Staging>()) {}

Arena::~Arena() {
  thread_->post([b = buffer_.release(), s = staging_.release()] {
    delete b;
    delete s;
  });
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
  buffer_->write(range->begin() * kWord, words.size() * kWord, words.data());
  // Some words at both ends and in the middle show whether they arrived.
  std::uint32_t sample[kSample];
  const std::size_t some = std::min(words.size(), kSample);
  for (const std::size_t at : {std::size_t{0}, (words.size() - some) / 2, words.size() - some}) {
    read(*buffer_, range->begin() + at, some, sample);
    thread_->require(std::equal(sample, sample + some, words.data() + at), "a mesh did not arrive");
  }
  return range;
}

void Arena::read(std::uint32_t begin, std::size_t words, std::uint32_t* to) { read(*buffer_, begin, words, to); }

void Arena::read(const Buffer& from, std::uint64_t begin, std::size_t words, std::uint32_t* to) {
  for (std::size_t done = 0; done < words;) {
    const std::size_t count = std::min(words - done, kMostAtOnce);
    staging_->copy(from, (begin + done) * kWord, count * kWord);
    thread_->awaitDevice();
    std::memcpy(to + done, staging_->take(), count * kWord);
    done += count;
  }
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
    std::uint32_t here[kSample], there[kSample];
    for (const std::uint64_t at : {std::uint64_t{0}, before / 2, before - kSample}) {
      read(*buffer_, at, kSample, here);
      read(*larger, at, kSample, there);
      thread_->require(std::equal(here, here + kSample, there), "a copy did not arrive");
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
