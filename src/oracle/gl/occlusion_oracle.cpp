// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/occlusion_oracle.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "oracle/gl/shaders.h"

namespace bocst::oracle::gl {
namespace {

constexpr std::size_t kMostQueries = 16384;                 // on their way at once
constexpr std::size_t kMostIndices = std::size_t{3} << 24;  // of one upload

}  // namespace

std::vector<Program::Stage> OcclusionOracle::sources(Form form) {
  // GLSL 3.30 has `precise` by an extension.
  const auto text = [](const char* name) {
    return "#version 330 core\n#extension GL_ARB_gpu_shader5 : enable\n#ifdef GL_ARB_gpu_shader5\n#define PRECISE "
           "precise\n#else\n#define PRECISE\n#endif\n" +
           shader(name);
  };
  std::vector<Program::Stage> stages = {{GL_VERTEX_SHADER, text("occlusion_vertex")},
                                        {GL_FRAGMENT_SHADER, text("occlusion_fragment")}};
  if (form == Form::kConservative) stages.push_back({GL_GEOMETRY_SHADER, text("occlusion_geometry")});
  return stages;
}

/// The OpenGL objects of an occlusion oracle. In the thread of the context.
class OcclusionQueries {
 public:
  OcclusionQueries(OcclusionOracle::Form form, int viewport, std::atomic<std::uint64_t>& asked)
      : asked_(asked),
        views_(form == OcclusionOracle::Form::kSampled ? 3 : 1),
        program_(OcclusionOracle::sources(form)) {
    center_ = program_.uniform("u_center");
    inverse_half_ = program_.uniform("u_inverse_half");
    axis_ = program_.uniform("u_axis");
    // A point needs one pixel.
    const GLsizei side = form == OcclusionOracle::Form::kSampled ? viewport : 1;
    glBindRenderbuffer(GL_RENDERBUFFER, color_.name());
    glRenderbufferStorage(GL_RENDERBUFFER, GL_R8, side, side);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_.name());
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
      throw OracleError("the driver cannot render to a picture of " + std::to_string(side) + " pixels a side");
    }
    side_ = side;
  }

  /// candidates[i]: the octants of question i that are seen. @throws OracleError
  void ask(const std::vector<ExpansionRequest*>& requests, std::vector<std::uint8_t>& candidates, Thread& thread) {
    forgetErrors();
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
    glViewport(0, 0, side_, side_);
    // 4.2: no culling, no writes; what is drawn is never looked at.
    glDisable(GL_CULL_FACE);
    glDisable(GL_DEPTH_TEST);
    glColorMask(GL_FALSE, GL_FALSE, GL_FALSE, GL_FALSE);
    glBindVertexArray(array_.name());
    program_.use();
    for (std::size_t first = 0; first < requests.size();) {
      const std::size_t end = part(requests, first);
      uploadLists(requests, first, end);
      for (GLint axis = 0; axis < views_; ++axis) askView(requests, first, end, axis, candidates, thread);
      first = end;
    }
    glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
    glBindVertexArray(0);
    thread.checkReset();
    throwOnError();
  }

 private:
  static std::size_t part(const std::vector<ExpansionRequest*>& requests, std::size_t first) {
    std::size_t indices = 0, end = first;
    while (end < requests.size() && 8 * (end - first + 1) <= kMostQueries) {
      if (requests[end]->ids != nullptr) indices += 3 * requests[end]->count;
      if (end > first && indices > kMostIndices) break;
      ++end;
    }
    return end;
  }

  void uploadLists(const std::vector<ExpansionRequest*>& requests, std::size_t first, std::size_t end) {
    std::vector<std::uint32_t> indices;
    begins_.assign(end - first, 0);
    for (std::size_t i = first; i < end; ++i) {
      const ExpansionRequest& e = *requests[i];
      begins_[i - first] = indices.size();
      if (e.ids == nullptr) continue;  // all of the mesh: its own index buffer
      for (std::size_t k = 0; k < e.count; ++k) {
        const Mesh::Indices& t = e.surface->mesh->indices(e.ids[k]);
        indices.insert(indices.end(), t.begin(), t.end());
      }
    }
    lists_.reserve(std::max<std::size_t>(indices.size(), 1) * sizeof(std::uint32_t));
    lists_.write(0, indices.size() * sizeof(std::uint32_t), indices.data());
  }

  static const void* at(std::size_t words) { return reinterpret_cast<const void*>(words * sizeof(std::uint32_t)); }

  void bind(const DeviceMesh& mesh) const {
    glBindBuffer(GL_ARRAY_BUFFER, mesh.buffer().name());
    constexpr GLsizei stride = 6 * sizeof(float);
    for (GLuint i = 0; i < 2; ++i) {
      glEnableVertexAttribArray(i);
      glVertexAttribPointer(i, 3, GL_FLOAT, GL_FALSE, stride, at(mesh.vertices() + 3 * i));
    }
  }

  // Asks for all octants that no view has shown so far, then reads what it learned.
  void askView(const std::vector<ExpansionRequest*>& requests, std::size_t first, std::size_t end, GLint axis,
               std::vector<std::uint8_t>& candidates, Thread& thread) {
    struct Asked {
      std::size_t request;
      int octant;
    };
    std::vector<Asked> asked;
    const DeviceMesh* bound = nullptr;
    glUniform1i(axis_, axis);
    for (std::size_t i = first; i < end; ++i) {
      const ExpansionRequest& e = *requests[i];
      if (meshOf(e) != bound) bind(*(bound = meshOf(e)));
      glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, e.ids == nullptr ? meshOf(e)->buffer().name() : lists_.name());
      const void* const begin = at(e.ids == nullptr ? meshOf(e)->indices() : begins_[i - first]);
      for (int o = 0; o < 8; ++o) {
        const lattice::Cell octant = e.cell.octant(o);
        if ((candidates[i] >> o & 1) != 0 || !e.surface->lattice.exists(octant)) continue;
        const auto corner = octant.corner();
        const float half = static_cast<float>(octant.side()) / 2;
        glUniform3f(center_, static_cast<float>(corner[0]) + half, static_cast<float>(corner[1]) + half,
                    static_cast<float>(corner[2]) + half);
        glUniform1f(inverse_half_, 1 / half);
        queries_.reserve(asked.size() + 1);
        glBeginQuery(GL_ANY_SAMPLES_PASSED, queries_[asked.size()]);
        glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * e.count), GL_UNSIGNED_INT, begin);
        glEndQuery(GL_ANY_SAMPLES_PASSED);
        asked.push_back({i, o});
      }
    }
    asked_ += asked.size();
    thread.awaitDevice();
    for (std::size_t q = 0; q < asked.size(); ++q) {
      GLuint seen = 0;
      glGetQueryObjectuiv(queries_[q], GL_QUERY_RESULT, &seen);
      if (seen != 0) candidates[asked[q].request] |= 1 << asked[q].octant;
    }
  }

  std::atomic<std::uint64_t>& asked_;
  const GLint views_;
  Program program_;
  GLint center_, inverse_half_, axis_;
  GLsizei side_ = 1;
  Renderbuffer color_;
  Framebuffer framebuffer_;
  VertexArray array_;
  Buffer lists_;
  std::vector<std::size_t> begins_;  // of each question's indices in lists_
  Queries queries_;
};

OcclusionOracle::OcclusionOracle(std::shared_ptr<Thread> thread, Form form, int viewport)
    : DeviceOracle(std::move(thread), false, std::numeric_limits<std::int32_t>::max()), form_(form) {
  thread_->run([&] { queries_ = std::make_unique<OcclusionQueries>(form, viewport, asked_); });
}

OcclusionOracle::~OcclusionOracle() {
  finish();
  thread_->post([queries = queries_.release()] { delete queries; });
}

std::vector<std::uint8_t> OcclusionOracle::candidates(const std::vector<ExpansionRequest*>& requests) {
  std::vector<std::uint8_t> candidates(requests.size(), 0);
  thread_->run([&] { queries_->ask(requests, candidates, *thread_); });
  return candidates;
}

void OcclusionOracle::answer(const std::vector<ExpansionRequest*>& requests, std::vector<Verdict>& verdicts) {
  constexpr std::size_t most = kMostIndices / 3;
  std::vector<std::size_t> order;
  std::vector<ExpansionRequest*> asked;
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const ExpansionRequest& e = *requests[i];
    if (e.surface->device == nullptr || (e.ids != nullptr && e.count > most)) continue;
    order.push_back(i);
    asked.push_back(requests[i]);
  }
  std::vector<std::uint8_t> candidates(asked.size(), 0);
  try {
    queries_->ask(asked, candidates, *thread_);
  } catch (const std::exception& e) {
    reportFailure("a batch", e);
    return;  // without candidates the CPU tests all octants
  }
  for (std::size_t i = 0; i < order.size(); ++i) {
    // The triangles should meet the cell, so an octant should be seen: else the CPU looks at all of them.
    const bool is_doubtful = form_ == Form::kConservative && candidates[i] == 0 && asked[i]->count > 0;
    verdicts[order[i]] = {Verdict::Kind::kCandidates, is_doubtful ? std::uint8_t{0xff} : candidates[i]};
  }
}

}  // namespace bocst::oracle::gl
