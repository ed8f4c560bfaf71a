// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/pair_walker.h"

#include <algorithm>
#include <cstring>

#include "oracle/gl/layout.h"
#include "oracle/gl/shaders.h"

namespace bocst::oracle::gl {
namespace {

using namespace layout;

// Any device allows a dispatch of this many groups.
constexpr std::size_t kMostPairs = 1 << 14;

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
  for (DeviceWalks::Tree& tree : walks.trees) {
    tree.used.assign((tree.blocks + 31) / 32, 0);
    tree.wanted.assign(tree.blocks / 4 + 1, 0);
  }
  for (std::size_t first = 0; first < walks.pairs.size(); first += kMostPairs) {
    walkPart(walks, first, std::min(kMostPairs, walks.pairs.size() - first), thread);
  }
}

void PairWalker::describe(const DeviceWalks& walks, std::size_t first, std::size_t count) {
  batch_ = batch_ % (kMostBatches - 1) + 1;  // never that of fresh memory
  answer_words_ = count * kPairAnswer;
  used_.clear();
  wanted_.clear();
  for (const DeviceWalks::Tree& tree : walks.trees) {
    used_.push_back(narrow(answer_words_));
    wanted_.push_back(narrow(answer_words_ + tree.used.size()));
    answer_words_ += tree.used.size() + tree.wanted.size();
  }
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
      at[kTreeWanted] = wanted_[pair.tree[t]];
      at[kTreeBlocks] = tree.blocks;
      at[kTreeRoot] = tree.root;
      at[kTreeDeepest] = tree.deepest;
      std::copy_n(tree.extent, 3, at + kTreeExtent);
    }
    row[kPairBatch] = batch_;
  }
}

void PairWalker::walkPart(DeviceWalks& walks, std::size_t first, std::size_t count, Thread& thread) {
  forgetErrors();
  describe(walks, first, count);
  const std::size_t bytes = answer_words_ * kWord;
  if (std::max(bytes, rows_.size() * kWord) > bytes_) throw OracleError("too many nodes for a buffer of the device");
  pairs_.reserve(rows_.size() * kWord);
  pairs_.write(0, rows_.size() * kWord, rows_.data());
  answers_.reserve(bytes);
  answers_.clear(bytes);
  const GLuint bound[] = {arena_.buffer().name(), pairs_.name(), answers_.name()};
  for (GLuint i = 0; i < 3; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, bound[i]);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  program_.use();
  glDispatchCompute(narrow(count), 1, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  staging_.copy(answers_, 0, bytes);
  thread.awaitDevice();
  const auto* const answers = static_cast<const std::uint32_t*>(staging_.take());
  throwOnError();
  take(walks, first, count, answers, thread);
}

void PairWalker::take(DeviceWalks& walks, std::size_t first, std::size_t count, const std::uint32_t* answers,
                      Thread& thread) const {
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint32_t* const row = answers + i * kPairAnswer;
    const std::uint32_t asked = check(rows_.data() + i * kPairWords, kPairWords);
    thread.require(row[0] >> 8 == batch_ && row[1] == asked, "a pair of trees was not walked");
    thread.require((row[0] & DeviceWalks::kInvalid) == 0, "a table of nodes did not arrive");
    walks.found[first + i] = static_cast<std::uint8_t>(row[0] & 0xff);
  }
  const auto add = [answers](std::vector<std::uint32_t>& bits, std::uint32_t begin) {
    for (std::size_t i = 0; i < bits.size(); ++i) bits[i] |= answers[begin + i];
  };
  for (std::size_t t = 0; t < walks.trees.size(); ++t) {
    add(walks.trees[t].used, used_[t]);
    add(walks.trees[t].wanted, wanted_[t]);
  }
}

}  // namespace bocst::oracle::gl
