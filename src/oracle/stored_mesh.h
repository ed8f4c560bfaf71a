// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <cstddef>
#include <cstdint>
#include <memory>

#include "oracle/oracle.h"

namespace bocst::oracle {

/// A copy of a mesh in the memory of an oracle's device, for a model without a mesh in host memory.
class StoredMesh {
 public:
  /// Uploads. @throws OracleError if the oracle cannot store it.
  StoredMesh(Oracle& oracle, const Mesh& mesh);

  /// Reads it back. @throws OracleError if the device lost it, or if other bytes came back.
  std::shared_ptr<const Mesh> recall() const;

  std::size_t bytes() const { return stored_->bytes(); }

 private:
  Oracle& oracle_;
  std::size_t vertices_, triangles_;
  std::uint64_t check_;
  std::shared_ptr<const DeviceResource> stored_;
};

}  // namespace bocst::oracle
