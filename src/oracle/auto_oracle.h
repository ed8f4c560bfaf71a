// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "oracle/cost_model.h"
#include "oracle/oracle.h"

namespace bocst::oracle {

/// Has each batch answered where that takes the least time (kAuto): by the host, by a device, or by both at once, each
/// a part. What they take is measured at the start and with each batch that is answered. The nodes of a tree are the
/// same wherever they were made; all lists come back to the host, so whoever made a node, either can go on below it.
///
/// A mesh is uploaded once the time that its batches would have saved on the device exceeds the upload's time.
///
/// Threads: any number. A thread that finds costs_mutex_ locked asks the host.
class BOCST_EXPORT AutoOracle : public Oracle {
 public:
  using Seconds = std::function<double()>;  ///< A clock.

  /// Measures both, which takes some milliseconds. host: answers in submit().
  AutoOracle(std::shared_ptr<Oracle> host, std::shared_ptr<Oracle> device, Seconds clock = steadySeconds);

  OracleKind kind() const override { return OracleKind::kAuto; }
  std::string name() const override { return host_->name() + " and " + device_->name(); }
  /// The device starts with its part; the host's is answered here.
  void submit(std::vector<ExpansionRequest>& batch) override;
  void wait(std::vector<ExpansionRequest>& batch) override;

  /// As the device has it.
  bool walksPairs(std::size_t pairs) override { return device_->walksPairs(pairs); }
  std::shared_ptr<const DeviceResource> uploadNodes(std::vector<std::uint32_t>& words) override {
    return device_->uploadNodes(words);
  }
  void walkPairs(DeviceWalks& walks) override { device_->walkPairs(walks); }
  void pairsTook(std::size_t pairs, double seconds, bool by_host) override {
    device_->pairsTook(pairs, seconds, by_host);
  }

  const std::shared_ptr<Oracle>& device() const { return device_; }

  static double steadySeconds();

 private:
  struct Work {
    double cells = 0, triangles = 0;
    void add(const ExpansionRequest& e);
  };
  /// A mesh on a lattice, and what the device has of it.
  struct Known {
    std::weak_ptr<const Mesh> mesh;
    lattice::Lattice lattice;
    std::shared_ptr<const DeviceResource> device = nullptr;  // null: nothing yet
    double saved = 0;                                        // seconds that the device would have saved
    bool refused = false;                                    // the device cannot take it
  };
  /// A batch of which the device has a part.
  struct Pending {
    const AutoOracle* oracle = nullptr;
    const std::vector<ExpansionRequest>* batch = nullptr;
    struct Place {
      std::size_t index;  // in the batch
      const Surface* surface;
      std::size_t ids_up_to;
    };
    std::vector<ExpansionRequest> part;  // the device's requests, moved out of the batch until wait(); empty if the
                                         // device has the whole batch
    std::vector<Place> places;           // where each was in the batch
    std::vector<std::unique_ptr<Surface>> surfaces;
    Work work;
    double expected = 0, begin = 0, host_end = 0;
  };
  /// A request that the device may answer.
  struct Candidate {
    std::size_t triangles, place;
    Known* mesh;
  };
  /// How many of the candidates, from the first on, are the device's part, and the time of the whole batch then.
  struct Share {
    std::size_t count = 0;
    double seconds = 0;
  };
  static std::list<Pending>& pendingOfThread();

  void measure();
  Share bestShare(const Work& batch, const std::vector<Candidate>& candidates, std::size_t least) const;
  bool isAllForDevice(const Work& batch) const;
  std::vector<Candidate> chooseShare(const std::vector<ExpansionRequest>& batch);
  Known& known(const Surface& surface);
  void upload(const Surface& surface, Known& its);
  void dropForgotten();
  Pending makePending(std::vector<ExpansionRequest>& batch, const std::vector<Candidate>& share) const;
  static std::vector<ExpansionRequest>& asked(Pending& pending, std::vector<ExpansionRequest>& batch) {
    return pending.part.empty() ? batch : pending.part;
  }
  void answerHere(std::vector<ExpansionRequest>& batch);
  void answerRest(std::vector<ExpansionRequest>& batch, const Pending& pending);
  void learn(CostModel& model, const Work& work, double seconds);

  const std::shared_ptr<Oracle> host_, device_;
  const Seconds clock_;
  // For what follows. Only try_lock is used: a child after fork() may find it locked for ever.
  std::mutex costs_mutex_;
  CostModel host_cost_, device_cost_, upload_cost_;
  std::multimap<const Mesh*, Known> meshes_;
  std::size_t live_meshes_ = 0;  // when forgotten ones were last dropped
  Trials trials_;
};

}  // namespace bocst::oracle
