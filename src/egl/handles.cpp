// SPDX-License-Identifier: BSD-3-Clause
#include "egl/handles.h"

#include <bocst/oracle.h>

#include <algorithm>

namespace bocst::oracle::gl {
namespace {

// Copies and clears need no binding of their own meaning.
constexpr GLenum kAnyTarget = GL_COPY_WRITE_BUFFER;

void forgetErrors() {
  while (glGetError() != GL_NO_ERROR) {
  }
}

}  // namespace

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

void Buffer::read(std::size_t offset, std::size_t bytes, void* data) const {
  if (bytes == 0) return;
  glBindBuffer(kAnyTarget, name());
  glGetBufferSubData(kAnyTarget, static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes), data);
}

void Buffer::clear(std::size_t bytes) {
  const GLuint zero = 0;
  glBindBuffer(kAnyTarget, name());
  glClearBufferSubData(kAnyTarget, GL_R32UI, 0, static_cast<GLsizeiptr>(bytes), GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
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
