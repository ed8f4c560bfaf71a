// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/pair_walker.h"

#include <algorithm>
#include <cstring>

#include "oracle/gl/layout.h"
#include "oracle/gl/shaders.h"

namespace bocst::oracle::gl {
namespace {

using namespace layout;

constexpr std::uint32_t kRootName = 0xffffffffu;  // as NodeRef

// Any device allows a dispatch of this many groups, and a part's deferred pairs take a few MB.
constexpr std::size_t kMostPairs = 1 << 14, kDeferredPerPair = 16, kLeastDeferred = 4096;

std::uint32_t bitsOf(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof(bits));
  return bits;
}

}  // namespace

struct PairWalker::Table : DeviceResource {
  std::shared_ptr<Arena::Range> range;
  std::uint32_t stamp = 0;
  std::size_t bytes() const override { return range->bytes(); }
};

std::string PairWalker::source() { return "#version 430 core\n" + constants() + shader("pairs"); }

PairWalker::PairWalker(Arena& arena, std::size_t bytes)
    : arena_(arena), bytes_(bytes), program_({{GL_COMPUTE_SHADER, source()}}) {}

std::shared_ptr<const DeviceResource> PairWalker::upload(std::vector<std::uint32_t>& words) {
  auto table = std::make_shared<Table>();
  table->stamp = ++stamp_;
  for (std::size_t at = node_table::kStamp; at < words.size(); at += node_table::kWords) words[at] = table->stamp;
  table->range = arena_.take(std::max<std::size_t>(1, words.size()));
  arena_.buffer().write(table->range->begin() * kWord, words.size() * kWord, words.data());
  return table;
}

void PairWalker::walk(DeviceWalks& walks, Thread& thread) {
  walks.found.assign(walks.pairs.size(), DeviceWalks::kUndone);
  walks.deferred.clear();
  for (DeviceWalks::Tree& tree : walks.trees) tree.used.assign((tree.blocks + 31) / 32, 0);
  for (std::size_t first = 0; first < walks.pairs.size(); first += kMostPairs) {
    walkPart(walks, first, std::min(kMostPairs, walks.pairs.size() - first), thread);
  }
}

void PairWalker::describe(const DeviceWalks& walks, std::size_t first, std::size_t count) {
  batch_ = batch_ % (kMostBatches - 1) + 1;  // never that of fresh memory
  std::size_t words = kPairHeader + count * kPairAnswer;
  used_.clear();
  for (const DeviceWalks::Tree& tree : walks.trees) {
    used_.push_back(narrow(words));
    words += tree.used.size();
  }
  deferred_ = narrow(words);
  room_ = narrow(std::max(kLeastDeferred, kDeferredPerPair * count));
  rows_.resize(count * kPairWords);
  for (std::size_t i = 0; i < count; ++i) {
    const DeviceWalks::Pair& pair = walks.pairs[first + i];
    std::uint32_t* const row = rows_.data() + i * kPairWords;
    std::memcpy(row + kPairRotation, pair.rotation, sizeof(pair.rotation));
    std::memcpy(row + kPairShift, pair.shift, sizeof(pair.shift));
    row[kPairUnit] = bitsOf(pair.unit);
    row[kPairMargin] = bitsOf(pair.rounding_margin);
    row[kPairTolerance] = bitsOf(pair.tolerance);
    row[kPairNotSmaller] = static_cast<std::uint32_t>(pair.not_smaller);
    for (std::size_t t = 0; t < 2; ++t) {
      const DeviceWalks::Tree& tree = walks.trees[pair.tree[t]];
      const Table& table = static_cast<const Table&>(*tree.nodes);
      std::uint32_t* const at = row + kPairTrees + t * kTreeWords;
      at[kTreeBegin] = table.range->begin();
      at[kTreeStamp] = table.stamp;
      at[kTreeUsed] = used_[pair.tree[t]];
      at[kTreeBlocks] = tree.blocks;
      at[kTreeRoot] = tree.root;
      at[kTreeDeepest] = tree.deepest;
      std::copy_n(tree.extent, 3, at + kTreeExtent);
    }
    row[kPairBatch] = batch_;
    row[kPairDeferred] = deferred_;
    row[kPairRoom] = room_;
  }
}

void PairWalker::walkPart(DeviceWalks& walks, std::size_t first, std::size_t count, Thread& thread) {
  forgetErrors();
  describe(walks, first, count);
  const std::size_t words = deferred_ + std::size_t{room_} * kDeferredWords;
  if (std::max(words, rows_.size()) * kWord > bytes_) throw OracleError("too many nodes for a buffer of the device");
  pairs_.reserve(rows_.size() * kWord);
  pairs_.write(0, rows_.size() * kWord, rows_.data());
  answers_.reserve(words * kWord);
  answers_.clear(deferred_ * kWord);
  const GLuint bound[] = {arena_.buffer().name(), pairs_.name(), answers_.name()};
  for (GLuint i = 0; i < 3; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, bound[i]);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  program_.use();
  glDispatchCompute(narrow(count), 1, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);

  // Most walks defer little; how much is known from the header.
  const auto read = [&](std::size_t deferred) {
    staging_.copy(answers_, 0, (deferred_ + deferred * kDeferredWords) * kWord);
    thread.awaitDevice();
    return static_cast<const std::uint32_t*>(staging_.take());
  };
  std::size_t come = std::min<std::size_t>(room_, count);
  const std::uint32_t* answers = read(come);
  const std::size_t deferred = std::min(answers[kDeferredCount], room_);
  if (deferred > come) answers = read(come = deferred);
  throwOnError();
  thread.require(std::min(answers[kDeferredCount], room_) == deferred, "what came back changed");
  take(walks, first, count, answers, thread);
}

void PairWalker::take(DeviceWalks& walks, std::size_t first, std::size_t count, const std::uint32_t* answers,
                      Thread& thread) const {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t* const row = answers + kPairHeader + i * kPairAnswer;
    std::uint32_t asked[kPairWords];
    std::copy_n(rows_.data() + i * kPairWords, kPairWords, asked);
    thread.require(row[0] >> 8 == batch_ && row[1] == check(asked), "a pair of trees was not walked");
    thread.require((row[0] & DeviceWalks::kInvalid) == 0, "a table of nodes did not arrive");
    walks.found[first + i] = static_cast<std::uint8_t>(row[0] & 0xff);
  }
  const auto exists = [](const DeviceWalks::Tree& tree, std::uint32_t node) {
    return node == kRootName || node >> 3 < tree.blocks;
  };
  const std::size_t deferred = std::min(answers[kDeferredCount], room_);
  for (std::size_t i = 0; i < deferred; ++i) {
    const std::uint32_t* const entry = answers + deferred_ + i * kDeferredWords;
    thread.require(entry[3] == batch_ && entry[0] < count, "what was deferred is not of this batch");
    const DeviceWalks::Pair& pair = walks.pairs[first + entry[0]];
    thread.require(exists(walks.trees[pair.tree[0]], entry[1]) && exists(walks.trees[pair.tree[1]], entry[2]),
                   "what was deferred is no node");
    walks.deferred.push_back({narrow(first + entry[0]), {entry[1], entry[2]}});
  }
  for (std::size_t t = 0; t < walks.trees.size(); ++t) {
    std::vector<std::uint32_t>& used = walks.trees[t].used;
    for (std::size_t i = 0; i < used.size(); ++i) used[i] |= answers[used_[t] + i];
  }
}

}  // namespace bocst::oracle::gl
