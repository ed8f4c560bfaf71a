// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/compute_chain.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <string>

#include "oracle/gl/layout.h"
#include "oracle/gl/shaders.h"

namespace bocst::oracle::gl {
namespace {

using namespace layout;

constexpr std::size_t kWord = sizeof(std::uint32_t);
constexpr std::uint64_t kMostGroups = 1 << 15;  // in one dimension; 65535 is the least that drivers must allow

std::string source(const std::string& name, bool clips) {
  return "#version 430 core\n" + constants() + shader("common") + (clips ? shader("clip") : "") + shader(name);
}

const DeviceMesh* meshOf(const ExpansionRequest& e) { return static_cast<const DeviceMesh*>(e.surface->device.get()); }

std::uint32_t narrow(std::uint64_t n) { return static_cast<std::uint32_t>(n); }

// So many cells that their states fit into one buffer.
ComputeChain::Limits clamped(ComputeChain::Limits limits) {
  limits.cells = std::max<std::size_t>(1, std::min(limits.cells, limits.bytes / (kStateWords * kWord)));
  return limits;
}

}  // namespace

ComputeChain::ComputeChain(Limits limits, Arena& arena) : limits_(clamped(limits)), arena_(arena) {
  GLint bindings = 0;
  glGetIntegerv(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS, &bindings);
  if (bindings < 8) throw OracleError("the driver binds only " + std::to_string(bindings) + " storage buffers, not 8");
  const std::pair<const char*, bool> passes[kPasses] = {{"masks", false}, {"decide", false},  {"place", false},
                                                        {"fill", true},   {"normals", false}, {"slabs", true},
                                                        {"pack", false}};
  times_.reserve(3);
  for (const auto& [name, clips] : passes) {
    auto program = std::make_unique<Program>(std::vector<Program::Stage>{{GL_COMPUTE_SHADER, source(name, clips)}});
    const Program& p = *program;
    steps_.push_back({std::move(program), p.uniform("u_pairs"), p.uniform("u_cells"), p.uniform("u_cell_count"),
                      p.uniform("u_list_capacity"), p.uniform("u_id_capacity")});
  }
}

bool ComputeChain::fits(const ExpansionRequest& e) const {
  const DeviceMesh& mesh = *meshOf(e);
  const std::size_t largest = std::max(mesh.vertices().bytes(), std::max(mesh.indices().bytes(), mesh.exact().bytes()));
  return e.count <= limits_.pairs && largest <= limits_.bytes && e.count * kWord <= limits_.bytes;
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

void ComputeChain::upload(const std::vector<ExpansionRequest*>& requests) {
  std::uint64_t uploads = 0;
  for (const ExpansionRequest* e : requests) {
    if (e->ids != nullptr) uploads += e->count;
  }
  uploaded_ = uploads > 0 ? arena_.take(uploads) : nullptr;
  std::vector<std::uint32_t> ids;
  ids.reserve(uploads);
  rows_.clear();
  ranges_.clear();
  std::uint32_t pairs = 0;
  for (const ExpansionRequest* request : requests) {
    const ExpansionRequest& e = *request;
    const double half = e.cell.side() / 2.0;
    Cell row{};
    for (std::size_t k = 0; k < 3; ++k) row.center[k] = static_cast<float>(e.cell.corner()[k] + half);
    row.half_side = static_cast<float>(half);
    row.first_pair = pairs;
    row.list = kAll;
    if (e.ids != nullptr) {
      row.list = uploaded_->begin() + narrow(ids.size());
      ids.insert(ids.end(), e.ids, e.ids + e.count);
    } else if (e.resource != nullptr) {
      row.list = e.resource_begin;
    }
    for (int o = 0; o < 8; ++o) {
      if (e.surface->lattice.exists(e.cell.octant(o))) row.exists |= 1u << o;
    }
    row.ids_up_to = narrow(std::min<std::size_t>(e.ids_up_to, 0xffffffffu));
    if (ranges_.empty() || ranges_.back().mesh != meshOf(e)) {
      const std::uint32_t cell = narrow(rows_.size());
      ranges_.push_back({meshOf(e), cell, cell, pairs, pairs});
    }
    rows_.push_back(row);
    pairs += narrow(e.count);
    ranges_.back().cell_end = narrow(rows_.size());
    ranges_.back().pair_end = pairs;
  }
  reserve(cells_, rows_.size() * sizeof(Cell) / kWord);
  cells_.write(0, rows_.size() * sizeof(Cell), rows_.data());
  reserve(states_, rows_.size() * kStateWords);
  states_.clear(rows_.size() * kStateWords * kWord);
  reserve(masks_, std::max<std::size_t>(pairs, 1));
  if (uploaded_ != nullptr) arena_.buffer().write(uploaded_->begin() * kWord, ids.size() * kWord, ids.data());
}

void ComputeChain::dispatch(Pass pass, std::uint64_t invocations) const {
  const std::uint64_t groups = (invocations + kGroup - 1) / kGroup;
  if (groups == 0) return;
  const std::uint64_t across = std::min(groups, kMostGroups);
  const Step& step = steps_[pass];
  step.program->use();
  glUniform1ui(step.cell_count, narrow(rows_.size()));
  glUniform2ui(step.list_capacity, placed_->begin(), narrow(list_capacity_));
  glUniform1ui(step.id_capacity, narrow(id_capacity_));
  glDispatchCompute(narrow(across), narrow((groups + across - 1) / across), 1);
}

void ComputeChain::dispatchPairs(Pass pass) const {
  for (const Range& r : ranges_) {
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, r.mesh->vertices().name());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 1, r.mesh->indices().name());
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 7, r.mesh->exact().name());
    steps_[pass].program->use();
    glUniform2ui(steps_[pass].pairs, r.pair_begin, r.pair_end);
    glUniform2ui(steps_[pass].cells, r.cell_begin, r.cell_end);
    dispatch(pass, r.pair_end - r.pair_begin);
  }
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

void ComputeChain::placeAndFill() {
  reserve(answers_, kHeader + rows_.size() * kRow + id_capacity_);
  answers_.clear(kHeader * kWord);
  const GLuint bound[] = {arena_.buffer().name(), cells_.name(), states_.name(), masks_.name(), answers_.name()};
  for (GLuint i = 0; i < 5; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2 + i, bound[i]);
  dispatch(kPlace, rows_.size());
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  dispatchPairs(kFill);
  dispatch(kNormals, 8 * rows_.size());
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  dispatchPairs(kSlabs);
  dispatch(kPack, rows_.size());
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
}

void ComputeChain::readBack(const std::vector<ExpansionRequest*>& requests) {
  for (std::size_t i = 0; i < requests.size(); ++i) {
    ExpansionRequest& e = *requests[i];
    const std::uint32_t* row = &words_[kHeader + i * kRow];
    CellAnswer answer;
    std::memcpy(static_cast<void*>(&answer), row, sizeof(answer));
    e.octants = answer.octants;
    e.own = answer.own;
    e.grey = answer.grey;
    const std::uint32_t* ids = &words_[kHeader + requests.size() * kRow] + row[kRowIds];
    std::uint32_t list = row[kRowList];
    e.lists.clear();
    e.kept_resource = nullptr;
    for (std::size_t o = 0; o < 8; ++o) {
      const std::uint32_t size = row[kRowSizes + o];
      const bool here = size <= e.ids_up_to;
      e.list_begin[o] = e.lists.size();
      e.device_lists[o] = here ? ExpansionRequest::DeviceList{} : ExpansionRequest::DeviceList{list, size};
      if (here) {
        e.lists.insert(e.lists.end(), ids, ids + size);
        ids += size;
      } else {
        e.kept_resource = placed_;
      }
      list += size;
    }
    e.list_begin[8] = e.lists.size();
  }
}

void ComputeChain::answer(const std::vector<ExpansionRequest*>& requests, Thread& thread) {
  while (glGetError() != GL_NO_ERROR) {
  }
  const auto begin = std::chrono::steady_clock::now();
  glQueryCounter(times_[0], GL_TIMESTAMP);
  upload(requests);
  std::uint64_t pairs = 0, ids = 0;
  for (const ExpansionRequest* e : requests) {
    pairs += e->count;
    ids += std::min<std::uint64_t>(2 * e->count, 8 * std::min<std::uint64_t>(e->ids_up_to, 1u << 28));
  }
  list_capacity_ = 2 * pairs + 8 * requests.size();
  id_capacity_ = ids + 64;
  placed_ = arena_.take(list_capacity_);
  glQueryCounter(times_[1], GL_TIMESTAMP);

  const GLuint bound[] = {arena_.buffer().name(), cells_.name(), states_.name(), masks_.name()};
  for (GLuint i = 0; i < 4; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 2 + i, bound[i]);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  dispatchPairs(kMasks);
  dispatchPairs(kDecide);
  placeAndFill();

  glQueryCounter(times_[2], GL_TIMESTAMP);

  // Most answers fit into the first read; what does not is known from the header.
  const std::size_t fixed = kHeader + requests.size() * kRow;
  std::size_t read = fixed + std::min<std::uint64_t>(id_capacity_, 64 * requests.size());
  const auto readFrom = [&](std::size_t first, std::size_t end) {
    words_.resize(end);
    answers_.read(first * kWord, (end - first) * kWord, words_.data() + first);
  };
  readFrom(0, read);
  if (words_[kListWords] > list_capacity_ || words_[kIdWords] > id_capacity_) {
    list_capacity_ = words_[kListWords];
    id_capacity_ = words_[kIdWords];
    placed_ = nullptr;
    placed_ = arena_.take(list_capacity_);
    placeAndFill();
    read = 0;
  }
  const std::size_t all = fixed + (read == 0 ? id_capacity_ : words_[kIdWords]);
  if (all > read) readFrom(read, all);
  const GLenum error = glGetError();
  thread.checkReset();
  if (error != GL_NO_ERROR) throw OracleError("OpenGL error " + std::to_string(error));
  placed_->trim(words_[kListWords]);
  readBack(requests);
  std::array<GLuint64, 3> times{};
  for (std::size_t i = 0; i < times.size(); ++i) glGetQueryObjectui64v(times_[i], GL_QUERY_RESULT, &times[i]);
  const std::chrono::duration<double> all_time = std::chrono::steady_clock::now() - begin;
  cost_.upload = 1e-9 * static_cast<double>(times[1] - times[0]);
  cost_.kernels = 1e-9 * static_cast<double>(times[2] - times[1]);
  cost_.read_back = all_time.count() - cost_.upload - cost_.kernels;
  placed_ = nullptr;
  uploaded_ = nullptr;
}

}  // namespace bocst::oracle::gl
