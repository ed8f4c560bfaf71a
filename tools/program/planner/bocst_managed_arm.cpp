// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/fcl.h>

#include "pairs/fcl_calls.h"
#include "planner/managed_arm_of.h"

namespace bocst::program {
namespace {

class BocstArm final : public ManagedArmOf<BocstManagedArm, FclCalls> {
 public:
  using ManagedArmOf::ManagedArmOf;

  void buildTrees() override {
    for (const auto& geometry : geometries()) static_cast<Modeld&>(*geometry).buildTree();
  }

  void rest(double seconds) override {
    const auto later =
        Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
    for (const auto& geometry : geometries()) static_cast<Modeld&>(*geometry).prune(later);
  }

  std::vector<std::uint64_t> growth() const override {
    std::vector<std::uint64_t> growth;
    for (const auto& geometry : geometries()) {
      const Statistics statistics = static_cast<const Modeld&>(*geometry).statistics();
      growth.push_back(statistics.built_triangles);
      growth.push_back(statistics.resident_bytes);
    }
    return growth;
  }
};

}  // namespace

std::unique_ptr<BocstManagedArm> manageBocstArm(const ArmWorld& world, const Options& options) {
  std::vector<std::shared_ptr<fcl::CollisionGeometryd>> geometries;
  for (const auto* bodies : {&world.links(), &world.things()}) {
    for (const ArmWorld::Thing& body : *bodies) {
      auto model = std::make_shared<Modeld>(body.mesh, options);
      model->computeLocalAABB();
      geometries.push_back(std::move(model));
    }
  }
  return std::make_unique<BocstArm>(world, std::move(geometries));
}

}  // namespace bocst::program
