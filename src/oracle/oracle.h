// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/oracle.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "bounds/node_bounds.h"
#include "lattice/lattice.h"
#include "oracle/device_walks.h"
#include "oracle/surface.h"

namespace bocst::oracle {

/// Something in an oracle's own memory; it goes when nobody holds it any more.
class DeviceResource {
 public:
  virtual ~DeviceResource() = default;
  virtual std::size_t bytes() const = 0;
};

/// The lists of a batch. All its answers share one pointer to them: one for each list would take as long as the rest.
struct BatchLists {
  std::vector<std::uint32_t> ids;                   ///< Of lists on the host, one after the other.
  std::shared_ptr<const DeviceResource> on_device;  ///< Has the lists that the oracle keeps.
};

/// One node to expand: the question and the answer.
struct ExpansionRequest {
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  /// A list that the oracle keeps for itself, in deviceLists().
  struct DeviceList {
    std::uint32_t begin = 0, count = 0;
  };

  // Asked.
  const Surface* surface = nullptr;
  lattice::Cell cell;
  const std::uint32_t* ids = nullptr;  ///< Triangles that may meet the cell; null: see `resource`.
  std::size_t count = 0;
  std::shared_ptr<const DeviceResource>
      resource;  ///< The list is one that this oracle keeps; null, and no ids: all of the mesh.
  std::uint32_t resource_begin = 0;
  std::size_t ids_up_to = kAll;  ///< Longer lists may stay with the oracle.

  // Answered.
  std::uint8_t grey = 0;       ///< Bit o: the surface meets octant o (reference.h), which has an actual region.
  std::uint8_t on_device = 0;  ///< Bit o: the oracle keeps octant o's list.
  bounds::OctantBounds octants;
  bounds::NodeBounds own;                ///< Of the cell itself: what the octants taught about it.
  std::array<std::uint32_t, 8> sizes{};  ///< Of each octant, how many triangles meet it.
  std::uint32_t first_on_host = 0;       ///< Where the lists on the host begin in batch->ids, or in `lists`, by octant.
  std::uint32_t first_on_device = 0;     ///< Where octant 0's list would be with the oracle, which has room for all.
  std::shared_ptr<const BatchLists> batch;  ///< Null where the answer has none of its lists.
  std::vector<std::uint32_t> lists;         ///< In place of those of the batch.

  std::size_t listSize(int o) const { return sizes[static_cast<std::size_t>(o)]; }
  bool isOnDevice(int o) const { return (on_device >> o & 1) != 0; }

  /// The triangles of octant o; none if the oracle keeps its list.
  const std::uint32_t* listBegin(int o) const {
    std::size_t begin = first_on_host;
    for (int p = 0; p < o; ++p) begin += isOnDevice(p) ? 0 : listSize(p);
    return (batch != nullptr ? batch->ids : lists).data() + begin;
  }
  const std::uint32_t* listEnd(int o) const { return listBegin(o + 1); }

  /// What has the lists that the oracle keeps; null where there are none.
  std::shared_ptr<const DeviceResource> deviceLists() const { return on_device != 0 ? batch->on_device : nullptr; }

  /// Where the oracle keeps octant o's list; empty if it does not.
  DeviceList deviceList(int o) const {
    if (!isOnDevice(o)) return {};
    return {std::accumulate(sizes.begin(), sizes.begin() + o, first_on_device), sizes[static_cast<std::size_t>(o)]};
  }
};

/// Answers expansion batches. Any number of threads may submit; each batch belongs to one thread until wait() returned.
class Oracle {
 public:
  virtual ~Oracle() = default;

  virtual OracleKind kind() const = 0;
  virtual std::string name() const = 0;

  /// Starts to answer a batch; an oracle without a device of its own may answer all of it here.
  virtual void submit(std::vector<ExpansionRequest>& batch) = 0;

  /// Returns when the whole batch is answered. @throws OracleError when a device was lost that had the only copy of a
  /// mesh.
  virtual void wait(std::vector<ExpansionRequest>& batch) = 0;

  /// Brings the surface to where the oracle works, if that is elsewhere, for as long as the result is held; null where
  /// it cannot. A surface that nobody keeps resident is brought again for each batch.
  virtual std::shared_ptr<const DeviceResource> makeResident(const Surface&) { return nullptr; }

  /// True if it needs the mesh on the host, too.
  virtual bool needsHostMesh() const { return true; }

  /// Keeps words where the oracle works; null where it cannot.
  virtual std::shared_ptr<const DeviceResource> store(const std::vector<std::uint32_t>&) { return nullptr; }

  /// Reads back what store() keeps. @throws OracleError when it is lost.
  virtual void recall(const DeviceResource&, std::vector<std::uint32_t>&) {
    throw OracleError("the oracle " + name() + " stores nothing");
  }

  /// Where the time of the last batch went, in seconds, as the device measured it. read_back is what else passed until
  /// the answers were there. All 0 without a device, and for batches before the first call: timing takes time.
  struct Cost {
    double upload = 0, kernels = 0, read_back = 0;
  };
  virtual Cost lastCost() { return {}; }

  /// Occlusion queries made so far, for all models.
  virtual std::uint64_t queries() const { return 0; }

  // Conservative answers to many poses, walked where the oracle works.

  /// True if this oracle is expected to walk this many pairs faster than the host.
  virtual bool walksPairs(std::size_t) { return false; }

  /// Brings a table of nodes (node_table) to where the oracle works; null where it cannot. Changes the words.
  virtual std::shared_ptr<const DeviceResource> uploadNodes(std::vector<std::uint32_t>&) { return nullptr; }

  /// Answers all pairs; of those that it cannot, kUndone.
  virtual void walkPairs(DeviceWalks& walks) {
    walks.found.assign(walks.pairs.size(), DeviceWalks::kUndone);
    for (DeviceWalks::Tree& tree : walks.trees) {
      tree.used.clear();
      tree.wanted.clear();
    }
  }

  /// Tells how long a walk over `pairs` took, uploads included. `by_host`: the host walked, not the oracle.
  virtual void pairsTook(std::size_t /*pairs*/, double /*seconds*/, bool /*by_host*/) {}

  /// The ids of a list that this oracle keeps; false when it has lost them.
  virtual bool fetch(const DeviceResource&, ExpansionRequest::DeviceList, std::uint32_t*) { return false; }
};

/// The oracle for these options; shared by all models. BOCST_ORACLE overrides kAuto; else exact answers, whose trees
/// the CPU builds in bulk, get the CPU; conservative ones get the CPU and, where there is one, a hardware GPU
/// (AutoOracle). viewport: PaperOptions::viewport.
/// @throws OracleError for one asked for by name that cannot be had.
BOCST_EXPORT std::shared_ptr<Oracle> makeOracle(OracleKind kind, Answer answer = Answer::kExact,
                                                int viewport = PaperOptions{}.viewport);

}  // namespace bocst::oracle
