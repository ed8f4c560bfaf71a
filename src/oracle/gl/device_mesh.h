// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

#include "egl/handles.h"
#include "oracle/gl/thread.h"
#include "oracle/oracle.h"

namespace bocst::oracle::gl {

/// A surface in device memory: its triangles, and its vertices in lattice units. Models of one mesh and one lattice
/// share it. 12 bytes a triangle and 24 a vertex, with `exact` 48.
class DeviceMesh : public DeviceResource {
 public:
  /// Uploads; from any thread but that of the context. exact: also the vertices in double.
  /// @throws OracleError when there is no room.
  DeviceMesh(std::shared_ptr<Thread> thread, const Surface& surface, bool exact);
  ~DeviceMesh() override;

  std::size_t bytes() const override { return bytes_; }
  std::size_t triangleCount() const { return triangle_count_; }

  /// In the thread of the context.
  const Buffer& vertices() const { return buffers_->vertices; }  ///< Six floats each: three high parts, three low.
  const Buffer& indices() const { return buffers_->indices; }
  const Buffer& exact() const { return buffers_->exact; }

 private:
  struct Buffers {
    Buffer vertices, indices, exact;
  };

  std::shared_ptr<Thread> thread_;
  std::unique_ptr<Buffers> buffers_;
  std::size_t triangle_count_ = 0, bytes_ = 0;
};

/// The device meshes of one context, found again by mesh and lattice as long as somebody holds them.
/// Thread-safe.
class DeviceMeshes {
 public:
  DeviceMeshes(std::shared_ptr<Thread> thread, bool exact) : thread_(std::move(thread)), exact_(exact) {}

  /// @throws OracleError
  std::shared_ptr<DeviceMesh> makeResident(const Surface& surface);

 private:
  struct Entry {
    std::weak_ptr<const Mesh> mesh;
    lattice::Lattice lattice;
    std::weak_ptr<DeviceMesh> device;
  };

  std::shared_ptr<Thread> thread_;
  const bool exact_;
  std::mutex mutex_;
  std::vector<Entry> entries_;
};

}  // namespace bocst::oracle::gl
