// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/device_mesh.h"

#include <algorithm>
#include <cstring>
#include <utility>

namespace bocst::oracle::gl {

DeviceMesh::DeviceMesh(Thread& thread, std::shared_ptr<Arena> arena, const Surface& surface, bool exact)
    : arena_(std::move(arena)) {
  const std::vector<Mesh::Indices>& triangles = surface.mesh->triangles();
  const std::vector<Eigen::Vector3d>& from = surface.mesh->vertices();
  const std::size_t vertices = 3 * triangles.size(), doubles = vertices + 6 * from.size();
  std::vector<std::uint32_t> words(doubles + (exact ? 6 * from.size() : 0));
  std::memcpy(words.data(), triangles.data(), triangles.size() * sizeof(triangles[0]));
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d p = surface.lattice.toLattice(from[i]);
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = p[static_cast<Eigen::Index>(k)];
      const auto high = static_cast<float>(x), low = static_cast<float>(x - static_cast<double>(high));
      std::memcpy(&words[vertices + 6 * i + k], &high, sizeof(high));
      std::memcpy(&words[vertices + 6 * i + 3 + k], &low, sizeof(low));
      if (exact) std::memcpy(&words[doubles + 6 * i + 2 * k], &x, sizeof(x));
    }
  }
  thread.run([&] { words_ = arena_->upload(words); });
  vertices_ = words_->begin() + static_cast<std::uint32_t>(vertices);
  exact_ = words_->begin() + static_cast<std::uint32_t>(doubles);
}

DeviceMeshes::DeviceMeshes(std::shared_ptr<Thread> thread, bool exact, std::size_t most_bytes)
    : thread_(std::move(thread)), exact_(exact) {
  thread_->run([&] { arena_ = std::make_shared<Arena>(thread_, most_bytes); });
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
  auto device = std::make_shared<DeviceMesh>(*thread_, arena_, surface, exact_);
  entries_.push_back({surface.mesh, surface.lattice, device});
  return device;
}

std::shared_ptr<const DeviceResource> DeviceMeshes::store(const std::vector<std::uint32_t>& words) {
  std::shared_ptr<Arena::Range> range;
  thread_->run([&] { range = arena_->upload(words); });
  return range;
}

void DeviceMeshes::recall(const DeviceResource& stored, std::vector<std::uint32_t>& words) {
  const auto& range = static_cast<const Arena::Range&>(stored);
  thread_->run([&] { arena_->read(range.begin(), words.size(), words.data()); });
}

}  // namespace bocst::oracle::gl
