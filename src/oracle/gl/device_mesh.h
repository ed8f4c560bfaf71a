// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/arena.h"
#include "oracle/gl/thread.h"
#include "oracle/oracle.h"

namespace bocst::oracle::gl {

/// A surface in device memory: its triangles, and its vertices in lattice units, in one arena with all others, so that
/// nothing is bound anew from mesh to mesh. Models of one mesh and one lattice share it. 12 bytes a triangle and 24 a
/// vertex, with `exact` 48.
class DeviceMesh : public DeviceResource {
 public:
  /// Uploads; from any thread but that of the context. exact: also the vertices in double.
  /// @throws OracleError when there is no room.
  DeviceMesh(Thread& thread, std::shared_ptr<Arena> arena, const Surface& surface, bool exact);

  std::size_t bytes() const override { return words_->bytes(); }

  /// In the thread of the context. The name changes when the arena grows.
  const Buffer& buffer() const { return arena_->buffer(); }
  /// Words of the buffer: three vertex numbers a triangle; six floats a vertex, three high parts and three low; three
  /// doubles a vertex.
  std::uint32_t indices() const { return words_->begin(); }
  std::uint32_t vertices() const { return vertices_; }
  std::uint32_t exact() const { return exact_; }

 private:
  std::shared_ptr<Arena> arena_;
  std::shared_ptr<const Arena::Range> words_;
  std::uint32_t vertices_ = 0, exact_ = 0;
};

/// The mesh that a request of an OpenGL oracle is about; null where the device does not have it.
inline const DeviceMesh* meshOf(const ExpansionRequest& e) {
  return static_cast<const DeviceMesh*>(e.surface->device.get());
}

/// The device meshes of one context, found again by mesh and lattice as long as somebody holds them.
/// Thread-safe.
class DeviceMeshes {
 public:
  /// They take at most `most_bytes` together. @throws OracleError when the context is lost.
  DeviceMeshes(std::shared_ptr<Thread> thread, bool exact, std::size_t most_bytes);

  /// @throws OracleError
  std::shared_ptr<DeviceMesh> makeResident(const Surface& surface);

  /// Words that the device keeps as they are, and reads back. @throws OracleError
  std::shared_ptr<const DeviceResource> store(const std::vector<std::uint32_t>& words);
  void recall(const DeviceResource& stored, std::vector<std::uint32_t>& words);

 private:
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    lattice::Lattice lattice;
    std::weak_ptr<DeviceMesh> device;
  };

  std::shared_ptr<Thread> thread_;
  std::shared_ptr<Arena> arena_;
  const bool exact_;
  std::mutex mutex_;
  std::vector<Entry> entries_;
};

}  // namespace bocst::oracle::gl
