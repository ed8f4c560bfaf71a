// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/device_mesh.h"

#include <algorithm>
#include <utility>

namespace bocst::oracle::gl {

DeviceMesh::DeviceMesh(std::shared_ptr<Thread> thread, const Surface& surface, bool exact)
    : thread_(std::move(thread)), triangle_count_(surface.mesh->triangleCount()) {
  const std::vector<Eigen::Vector3d>& from = surface.mesh->vertices();
  std::vector<float> parts(6 * from.size());
  std::vector<double> whole(exact ? 3 * from.size() : 0);
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d p = surface.lattice.toLattice(from[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = p[static_cast<Eigen::Index>(k)];
      const auto high = static_cast<float>(x);
      parts[6 * i + k] = high;
      parts[6 * i + 3 + k] = static_cast<float>(x - static_cast<double>(high));
      if (exact) whole[3 * i + k] = x;
    }
  }
  const std::vector<Mesh::Indices>& triangles = surface.mesh->triangles();
  try {
    thread_->run([&] {
      buffers_ = std::make_unique<Buffers>();
      buffers_->vertices = Buffer(parts.size() * sizeof(float), parts.data());
      buffers_->indices = Buffer(triangles.size() * sizeof(triangles[0]), triangles.data());
      if (exact) buffers_->exact = Buffer(whole.size() * sizeof(double), whole.data());
    });
  } catch (...) {
    if (buffers_ != nullptr) thread_->post([b = buffers_.release()] { delete b; });
    throw;
  }
  bytes_ = buffers_->vertices.bytes() + buffers_->indices.bytes() + buffers_->exact.bytes();
}

DeviceMesh::~DeviceMesh() {
  // OpenGL names end in the thread of their context; with a context that is lost they are gone already.
  thread_->post([b = buffers_.release()] { delete b; });
}

std::shared_ptr<DeviceMesh> DeviceMeshes::makeResident(const Surface& surface) {
  if (thread_->isLost()) throw OracleError("the GPU context is lost");
  const std::lock_guard<std::mutex> lock(mutex_);
  entries_.erase(std::remove_if(entries_.begin(), entries_.end(), [](const Entry& e) { return e.device.expired(); }),
                 entries_.end());
  for (const Entry& e : entries_) {
    if (e.mesh.lock() != surface.mesh || !(e.lattice == surface.lattice)) continue;
    if (std::shared_ptr<DeviceMesh> device = e.device.lock()) return device;
  }
  auto device = std::make_shared<DeviceMesh>(thread_, surface, exact_);
  entries_.push_back({surface.mesh, surface.lattice, device});
  return device;
}

}  // namespace bocst::oracle::gl
