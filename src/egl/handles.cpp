// SPDX-License-Identifier: BSD-3-Clause
#include "egl/handles.h"

#include <bocst/oracle.h>

#include <algorithm>

namespace bocst::oracle::gl {
namespace {

// Copies and clears need no binding of their own meaning.
constexpr GLenum kAnyTarget = GL_COPY_WRITE_BUFFER;

}  // namespace

void forgetErrors() {
  while (glGetError() != GL_NO_ERROR) {
  }
}

void throwOnError() {
  const GLenum error = glGetError();
  if (error != GL_NO_ERROR) throw OracleError("OpenGL error " + std::to_string(error));
}

Buffer::Buffer(std::size_t bytes, const void* data) {
  reserve(bytes);
  write(0, bytes, data);
}

void Buffer::reserve(std::size_t bytes) {
  if (bytes <= bytes_) return;
  forgetErrors();
  glBindBuffer(kAnyTarget, name());
  glBufferData(kAnyTarget, static_cast<GLsizeiptr>(bytes), nullptr, GL_DYNAMIC_COPY);
  if (glGetError() != GL_NO_ERROR) {
    bytes_ = 0;
    throw OracleError("the GPU has no memory for a buffer of " + std::to_string(bytes) + " bytes");
  }
  bytes_ = bytes;
}

void Buffer::write(std::size_t offset, std::size_t bytes, const void* data) {
  if (bytes == 0) return;
  glBindBuffer(kAnyTarget, name());
  glBufferSubData(kAnyTarget, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes), data);
}

void Buffer::clear(std::size_t bytes) {
  const GLuint zero = 0;
  glBindBuffer(kAnyTarget, name());
  glClearBufferSubData(kAnyTarget, GL_R32UI, 0, static_cast<GLsizeiptr>(bytes), GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
}

void Staging::copy(const Buffer& from, std::size_t begin, std::size_t bytes) {
  if (mapped_ != nullptr && !stays_mapped_) {
    glBindBuffer(kAnyTarget, name_);
    glUnmapBuffer(kAnyTarget);
    mapped_ = nullptr;
  }
  if (bytes > bytes_) {
    release();
    forgetErrors();
    glGenBuffers(1, &name_);
    glBindBuffer(kAnyTarget, name_);
    const std::size_t room = std::max<std::size_t>(2 * bytes, 1 << 16);
    stays_mapped_ = epoxy_gl_version() >= 44 || epoxy_has_gl_extension("GL_ARB_buffer_storage");
    if (stays_mapped_) {
      constexpr GLbitfield flags = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
      glBufferStorage(kAnyTarget, static_cast<GLsizeiptr>(room), nullptr, flags | GL_CLIENT_STORAGE_BIT);
      mapped_ = glMapBufferRange(kAnyTarget, 0, static_cast<GLsizeiptr>(room), flags);
    } else {
      glBufferData(kAnyTarget, static_cast<GLsizeiptr>(room), nullptr, GL_STREAM_READ);
    }
    if (glGetError() != GL_NO_ERROR || (stays_mapped_ && mapped_ == nullptr)) {
      throw OracleError("the GPU has no memory to read back " + std::to_string(room) + " bytes");
    }
    bytes_ = room;
  }
  copied_ = bytes;
  glBindBuffer(GL_COPY_READ_BUFFER, from.name());
  glBindBuffer(kAnyTarget, name_);
  glCopyBufferSubData(GL_COPY_READ_BUFFER, kAnyTarget, static_cast<GLintptr>(begin), 0, static_cast<GLsizeiptr>(bytes));
}

const void* Staging::take() {
  if (mapped_ == nullptr) {
    glBindBuffer(kAnyTarget, name_);
    mapped_ = glMapBufferRange(kAnyTarget, 0, static_cast<GLsizeiptr>(copied_), GL_MAP_READ_BIT);
    if (mapped_ == nullptr) throw OracleError("the driver does not let the host read what was computed");
  }
  return mapped_;
}

void Staging::release() {
  if (name_ != 0) glDeleteBuffers(1, &name_);  // which unmaps it
  name_ = 0;
  bytes_ = 0;
  mapped_ = nullptr;
}

Queries::~Queries() {
  if (!names_.empty()) glDeleteQueries(static_cast<GLsizei>(names_.size()), names_.data());
}

void Queries::reserve(std::size_t count) {
  const std::size_t before = names_.size();
  if (count <= before) return;
  names_.resize(std::max(count, 2 * before));
  glGenQueries(static_cast<GLsizei>(names_.size() - before), names_.data() + before);
}

Program::Program(const std::vector<Stage>& stages) : name_(glCreateProgram()) {
  std::string log(4096, '\0');
  const auto fail = [&](const std::string& what) {
    log.resize(log.find('\0'));
    glDeleteProgram(name_);
    throw OracleError("the driver refuses " + what + ": " + log);
  };
  for (const Stage& stage : stages) {
    const GLuint shader = glCreateShader(stage.type);
    const char* source = stage.source.c_str();
    glShaderSource(shader, 1, &source, nullptr);
    glCompileShader(shader);
    GLint ok = GL_FALSE;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) glGetShaderInfoLog(shader, static_cast<GLsizei>(log.size()), nullptr, log.data());
    if (ok) glAttachShader(name_, shader);
    glDeleteShader(shader);  // attached ones live as long as the program
    if (!ok) fail("a shader");
  }
  glLinkProgram(name_);
  GLint ok = GL_FALSE;
  glGetProgramiv(name_, GL_LINK_STATUS, &ok);
  if (!ok) {
    glGetProgramInfoLog(name_, static_cast<GLsizei>(log.size()), nullptr, log.data());
    fail("a program");
  }
}

}  // namespace bocst::oracle::gl
