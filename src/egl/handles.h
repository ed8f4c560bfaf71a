// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <epoxy/gl.h>

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace bocst::oracle::gl {

// In the thread of the context.

/// Drops what calls before have left.
void forgetErrors();
/// @throws OracleError if a call since forgetErrors() has failed.
void throwOnError();

/// Owns one OpenGL name. Made, used and ended in the thread of its context.
template <void (*kMake)(GLuint*), void (*kEnd)(GLuint)>
class Handle {
 public:
  Handle() { kMake(&name_); }
  ~Handle() {
    if (name_ != 0) kEnd(name_);
  }
  Handle(Handle&& other) noexcept : name_(std::exchange(other.name_, 0)) {}
  Handle& operator=(Handle&& other) noexcept {
    std::swap(name_, other.name_);
    return *this;
  }
  GLuint name() const { return name_; }

 private:
  GLuint name_ = 0;
};

namespace detail {
inline void makeBuffer(GLuint* n) { glGenBuffers(1, n); }
inline void endBuffer(GLuint n) { glDeleteBuffers(1, &n); }
inline void makeArray(GLuint* n) { glGenVertexArrays(1, n); }
inline void endArray(GLuint n) { glDeleteVertexArrays(1, &n); }
inline void makeFramebuffer(GLuint* n) { glGenFramebuffers(1, n); }
inline void endFramebuffer(GLuint n) { glDeleteFramebuffers(1, &n); }
inline void makeRenderbuffer(GLuint* n) { glGenRenderbuffers(1, n); }
inline void endRenderbuffer(GLuint n) { glDeleteRenderbuffers(1, &n); }
}  // namespace detail

using VertexArray = Handle<detail::makeArray, detail::endArray>;
using Framebuffer = Handle<detail::makeFramebuffer, detail::endFramebuffer>;
using Renderbuffer = Handle<detail::makeRenderbuffer, detail::endRenderbuffer>;

/// A buffer object that knows its size. @throws OracleError when the device has no memory for it.
/// The host reads it by Staging: after one glGetBufferSubData, a driver may keep all of a buffer in host memory, as
/// NVIDIA's does, which then moves it at each use.
class Buffer {
 public:
  Buffer() = default;
  Buffer(std::size_t bytes, const void* data);

  GLuint name() const { return handle_.name(); }
  std::size_t bytes() const { return bytes_; }

  /// Makes it at least this large, in bytes; its contents are lost if it had fewer.
  void reserve(std::size_t bytes);
  void write(std::size_t offset, std::size_t bytes, const void* data);
  /// All bytes to zero from the start on.
  void clear(std::size_t bytes);

 private:
  Handle<detail::makeBuffer, detail::endBuffer> handle_;
  std::size_t bytes_ = 0;
};

/// Device memory that the host reads what was computed from, so that buffers of shaders stay where they are fast.
/// Mapped once for all where the driver can (OpenGL 4.4), else at each read.
class Staging {
 public:
  Staging() = default;
  ~Staging() { release(); }
  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  /// Starts to copy bytes of a buffer; what take() gave before is gone.
  void copy(const Buffer& from, std::size_t begin, std::size_t bytes);
  /// What was copied, once the device has done all that it was told. @throws OracleError when it cannot be mapped.
  const void* take();

 private:
  void release();

  GLuint name_ = 0;
  std::size_t bytes_ = 0, copied_ = 0;
  void* mapped_ = nullptr;
  bool stays_mapped_ = false;
};

/// As many query objects as were ever asked for.
class Queries {
 public:
  ~Queries();
  Queries() = default;
  Queries(const Queries&) = delete;
  Queries& operator=(const Queries&) = delete;

  void reserve(std::size_t count);
  GLuint operator[](std::size_t i) const { return names_[i]; }

 private:
  std::vector<GLuint> names_;
};

/// A linked program. @throws OracleError with the driver's message.
class Program {
 public:
  struct Stage {
    GLenum type;
    std::string source;
  };
  explicit Program(const std::vector<Stage>& stages);
  ~Program() { glDeleteProgram(name_); }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void use() const { glUseProgram(name_); }
  GLint uniform(const char* name) const { return glGetUniformLocation(name_, name); }

 private:
  GLuint name_ = 0;
};

}  // namespace bocst::oracle::gl
