// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/compute_chain.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <numeric>
#include <string>

#include "oracle/gl/layout.h"
#include "oracle/gl/shaders.h"

namespace bocst::oracle::gl {
namespace {

using namespace layout;

struct PassSource {
  const char* name;
  bool clips;
};
// As in ComputeChain::Pass.
constexpr PassSource kSources[] = {{"masks", false},   {"decide", false}, {"place", false}, {"fill", true},
                                   {"normals", false}, {"slabs", true},   {"pack", false}};

// A dispatch of more would take long enough for a watchdog of a slow device.
constexpr std::uint64_t kMostInvocations = std::uint64_t{1} << 22;

// At most as many cells as have room for their states in one buffer.
ComputeChain::Limits clamped(ComputeChain::Limits limits) {
  limits.cells = std::max<std::size_t>(1, std::min(limits.cells, limits.bytes / (kStateWords * kWord)));
  return limits;
}

}  // namespace

std::vector<std::pair<std::string, std::string>> ComputeChain::sources() {
  std::vector<std::pair<std::string, std::string>> all;
  for (const PassSource& pass : kSources) {
    all.emplace_back(pass.name, "#version 430 core\n" + constants() +
                                    "const uint kPass = " + std::to_string(all.size()) + "u;\n" + shader("common") +
                                    (pass.clips ? shader("clip") : "") + shader(pass.name));
  }
  return all;
}

ComputeChain::ComputeChain(Limits limits, Arena& arena) : limits_(clamped(limits)), arena_(arena) {
  GLint bindings = 0;
  glGetIntegerv(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, &bindings);
  if (bindings < 6) throw OracleError("the driver binds only " + std::to_string(bindings) + " storage buffers, not 6");
  times_.reserve(3);
  for (const auto& [name, source] : sources()) {
    auto program = std::make_unique<Program>(std::vector<Program::Stage>{{GL_COMPUTE_SHADER, source}});
    const Program& p = *program;
    steps_.push_back({std::move(program), p.uniform("u_items"), p.uniform("u_lanes"), p.uniform("u_cell_count"),
                      p.uniform("u_list_capacity"), p.uniform("u_id_capacity"), p.uniform("u_batch")});
  }
}

bool ComputeChain::fits(const ExpansionRequest& e) const {
  return e.count <= limits_.pairs && e.count * kWord <= limits_.bytes;
}

std::size_t ComputeChain::part(const std::vector<ExpansionRequest*>& requests, std::size_t first) const {
  std::uint64_t pairs = 0;
  std::size_t n = 0;
  while (first + n < requests.size() && n < limits_.cells) {
    pairs += requests[first + n]->count;
    if (n > 0 && pairs > limits_.pairs) break;
    ++n;
  }
  return n;
}

// What a shader reaches beyond the limit reads as nothing, and nothing means white: that must not happen unseen.
void ComputeChain::reserve(Buffer& buffer, std::size_t words) const {
  if (words * kWord > limits_.bytes) {
    throw OracleError("a table of " + std::to_string(words * kWord) + " bytes is more than the device takes");
  }
  buffer.reserve(words * kWord);
}

// All that is asked, on the host.
void ComputeChain::describe(const std::vector<ExpansionRequest*>& requests) {
  batch_ = batch_ % (kMostBatches - 1) + 1;  // never that of fresh memory
  rows_.clear();
  ids_.clear();
  sums_.clear();
  is_uploaded_.clear();
  meshes_ = meshOf(*requests.front())->buffer().name();
  std::uint64_t pairs = 0, ids = 0;
  for (const ExpansionRequest* request : requests) {
    const ExpansionRequest& e = *request;
    const DeviceMesh& mesh = *meshOf(e);
    const double half = e.cell.side() / 2.0;
    Cell row{};
    for (std::size_t k = 0; k < 3; ++k) row.center[k] = static_cast<float>(e.cell.corner()[k] + half);
    row.half_side = static_cast<float>(half);
    row.first_pair = narrow(pairs);
    row.list = e.ids != nullptr ? narrow(ids_.size()) : e.resource != nullptr ? e.resource_begin : kAll;
    for (int o = 0; o < 8; ++o) {
      if (e.surface->lattice.exists(e.cell.octant(o))) row.exists |= 1u << o;
    }
    row.ids_up_to = narrow(std::min<std::size_t>(e.ids_up_to, 0xffffffffu));
    row.indices = mesh.indices();
    row.vertices = mesh.vertices();
    row.exact = mesh.exact();
    row.batch = batch_;
    rows_.push_back(row);
    std::uint32_t sum = 0;
    if (e.ids != nullptr) {
      ids_.insert(ids_.end(), e.ids, e.ids + e.count);
      sum = std::accumulate(e.ids, e.ids + e.count, narrow(e.count));
    } else if (e.resource == nullptr) {
      sum = narrow(std::uint64_t{e.count} * (e.count + 1) / 2);
    }
    sums_.push_back(sum);
    is_uploaded_.push_back(e.ids != nullptr);
    pairs += e.count;
    ids += std::min<std::uint64_t>(2 * e.count, 8 * std::min<std::uint64_t>(e.ids_up_to, 1u << 28));
  }
  pairs_ = pairs;
  list_capacity_ = 2 * pairs + 8 * requests.size();
  id_capacity_ = ids + 64;
}

void ComputeChain::upload() {
  uploaded_ = ids_.empty() ? nullptr : arena_.take(ids_.size());
  for (std::size_t i = 0; i < rows_.size() && uploaded_ != nullptr; ++i) {
    if (is_uploaded_[i]) rows_[i].list += uploaded_->begin();
  }
  checks_.clear();
  for (const Cell& row : rows_) checks_.push_back(check(row));
  placed_ = arena_.take(list_capacity_);
  reserve(cells_, rows_.size() * sizeof(Cell) / kWord);
  cells_.write(0, rows_.size() * sizeof(Cell), rows_.data());
  reserve(states_, rows_.size() * kStateWords);
  states_.clear(rows_.size() * kStateWords * kWord);
  reserve(masks_, std::max<std::size_t>(pairs_, 1));
  if (uploaded_ != nullptr) arena_.buffer().write(uploaded_->begin() * kWord, ids_.size() * kWord, ids_.data());
  clearAnswers();
}

void ComputeChain::clearAnswers() {
  groups_.fill(0);
  reserve(answers_, kHeader + rows_.size() * kRow + id_capacity_ + 1);
  answers_.clear(kHeader * kWord);
  const GLuint bound[] = {meshes_,        arena_.buffer().name(), cells_.name(),
                          states_.name(), masks_.name(),          answers_.name()};
  for (GLuint i = 0; i < 6; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, bound[i]);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

// `lanes`: the number of lanes that work on each pair or cell. Long passes are split.
void ComputeChain::run(Pass pass, std::uint64_t items, std::uint32_t lanes) {
  const Step& step = steps_[pass];
  step.program->use();
  glUniform1ui(step.cell_count, narrow(rows_.size()));
  glUniform2ui(step.list_capacity, placed_->begin(), narrow(list_capacity_));
  glUniform1ui(step.id_capacity, narrow(id_capacity_));
  glUniform1ui(step.batch, batch_);
  glUniform1ui(step.lanes, lanes);
  const std::uint64_t most = kMostInvocations / lanes;
  for (std::uint64_t first = 0; first < items; first += most) {
    const std::uint64_t end = std::min(items, first + most);
    if (first > 0) glFlush();
    glUniform2ui(step.items, narrow(first), narrow(end));
    const std::uint32_t groups = narrow(((end - first) * lanes + kGroup - 1) / kGroup);
    groups_[pass] += groups;
    glDispatchCompute(groups, 1, 1);
  }
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void ComputeChain::fill() {
  const std::uint32_t lanes = pairs_ <= limits_.few_pairs.value_or(0) ? 8 : 1;
  run(kPlace, rows_.size());
  run(kFill, pairs_, lanes);
  run(kNormals, rows_.size(), 64);
  run(kSlabs, pairs_, lanes);
  run(kPack, rows_.size(), 8);
}

const std::uint32_t* ComputeChain::read(std::size_t words, Thread& thread) {
  staging_.copy(answers_, 0, words * kWord);
  thread.awaitDevice();
  return static_cast<const std::uint32_t*>(staging_.take());
}

void ComputeChain::checkHeader(const std::uint32_t* answers, Thread& thread) const {
  thread.require(std::equal(groups_.begin(), groups_.end(), answers + kGroups), "work groups did not run");
  thread.require((answers[kFailed] & kMasksFailed) == 0, "a pass did not see what the one before it wrote");
  thread.require((answers[kFailed] & kListsFailed) == 0, "a list was not filled");
}

void ComputeChain::take(const std::vector<ExpansionRequest*>& requests, const std::uint32_t* answers,
                        Thread& thread) const {
  const std::uint32_t* const all_ids = answers + kHeader + requests.size() * kRow;
  thread.require(all_ids[answers[kIdWords]] == batch_, "what came back is not of this batch");
  std::uint32_t wrong = 0;
  const auto lists = std::make_shared<const BatchLists>(BatchLists{{all_ids, all_ids + answers[kIdWords]}, placed_});
  for (std::size_t i = 0; i < requests.size(); ++i) {
    ExpansionRequest& e = *requests[i];
    const std::uint32_t* const row = answers + kHeader + i * kRow;
    wrong |= row[kRowCheck] ^ checks_[i];
    thread.require(sums_[i] == 0 || row[kRowSum] == sums_[i], "it saw other triangles");
    CellAnswer answer;
    std::memcpy(static_cast<void*>(&answer), row, sizeof(answer));
    e.octants = answer.octants;
    e.own = answer.own;
    e.grey = answer.grey;
    std::copy_n(row + kRowSizes, 8, e.sizes.begin());
    e.first_on_device = row[kRowList];
    e.on_device = 0;
    std::size_t here = 0;
    // Without branches: octants differ in what they keep.
    for (unsigned o = 0; o < 8; ++o) {
      const bool stays = e.sizes[o] > e.ids_up_to;
      e.on_device = static_cast<std::uint8_t>(e.on_device | unsigned{stays} << o);
      here += stays ? 0 : e.sizes[o];
    }
    thread.require(row[kRowIds] + here <= answers[kIdWords], "a list is longer than what came back");
    e.first_on_host = here != 0 ? row[kRowIds] : 0;
    e.batch = nullptr;
    if (e.on_device != 0 || here != 0) e.batch = lists;
  }
  thread.require(wrong == 0, "a cell was not answered");
}

void ComputeChain::answer(const std::vector<ExpansionRequest*>& requests, Thread& thread) {
  forgetErrors();
  const auto begin = std::chrono::steady_clock::now();
  const auto stamp = [this](std::size_t i) {
    if (is_timed_) glQueryCounter(times_[i], GL_TIMESTAMP);
  };
  const bool is_timed = is_timed_;
  // Released on every path: a range keeps the arena and the Thread alive, and a Thread must not end in its own thread.
  struct Release {
    ComputeChain& chain;
    ~Release() { chain.placed_ = chain.uploaded_ = nullptr; }
  } release{*this};
  stamp(0);
  describe(requests);
  upload();
  stamp(1);
  run(kMasks, pairs_);
  run(kDecide, pairs_);
  fill();
  stamp(2);

  // All that there is room for: a second read would take as long as some 100 000 words.
  const std::size_t fixed = kHeader + requests.size() * kRow;
  const std::uint32_t* answers = read(fixed + id_capacity_ + 1, thread);
  checkHeader(answers, thread);
  if (answers[kListWords] > list_capacity_ || answers[kIdWords] > id_capacity_) {
    list_capacity_ = answers[kListWords];
    id_capacity_ = answers[kIdWords];
    placed_ = nullptr;
    placed_ = arena_.take(list_capacity_);
    clearAnswers();
    fill();
    answers = read(fixed + id_capacity_ + 1, thread);
    checkHeader(answers, thread);
    thread.require(answers[kListWords] == list_capacity_ && answers[kIdWords] == id_capacity_, "lists changed");
  }
  throwOnError();
  placed_->trim(answers[kListWords]);
  take(requests, answers, thread);
  if (is_timed) findCost(std::chrono::steady_clock::now() - begin);
}

void ComputeChain::findCost(std::chrono::duration<double> all) {
  std::array<GLuint64, 3> times{};
  for (std::size_t i = 0; i < times.size(); ++i) glGetQueryObjectui64v(times_[i], GL_QUERY_RESULT, &times[i]);
  cost_.upload = 1e-9 * static_cast<double>(times[1] - times[0]);
  cost_.kernels = 1e-9 * static_cast<double>(times[2] - times[1]);
  cost_.read_back = all.count() - cost_.upload - cost_.kernels;
}

}  // namespace bocst::oracle::gl
