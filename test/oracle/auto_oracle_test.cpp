// SPDX-License-Identifier: BSD-3-Clause
// kAuto beside devices that are simulated: they answer as the CPU does, but on a clock of their own, with the latency,
// the rates and the failures that a test sets. Nothing is timed, so every run does the same.
#include "oracle/auto_oracle.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <random>

#include "egl/context.h"
#include "oracle/cpu/cpu_oracle.h"
#include "oracle/gl/compute_oracle.h"
#include "sanitized.h"
#include "surfaces.h"
#include "thread_group.h"

namespace bocst::oracle {
namespace {

using Lists = std::vector<std::vector<std::uint32_t>>;

// Of one thread of a query.
struct Time {
  double now = 0;
  AutoOracle::Seconds clock() {
    return [this] { return now; };
  }
};

struct Rates {
  double cell = 0.8e-6, triangle = 6e-8;  // seconds; not in the ratio that is expected at the start
  double of(const std::vector<ExpansionRequest>& batch) const {
    double seconds = 0;
    for (const ExpansionRequest& e : batch) seconds += cell + triangle * static_cast<double>(e.count);
    return seconds;
  }
};

class SimulatedHost : public CpuOracle {
 public:
  explicit SimulatedHost(Time& time) : time_(time) {}
  void submit(std::vector<ExpansionRequest>& batch) override {
    if (throws) throw std::bad_alloc();
    if (answers) CpuOracle::submit(batch);
    time_.now += Rates().of(batch);
    cells += batch.size();
  }
  std::size_t cells = 0;
  bool answers = true;  // or only their time passes
  bool throws = false;

 private:
  Time& time_;
};

class SimulatedDevice : public CpuOracle {
 public:
  struct Resource : DeviceResource {
    Resource(const Surface& on, int& all) : mesh(on.mesh.get()), lattice(on.lattice), count(all) { ++count; }
    ~Resource() override { --count; }
    std::size_t bytes() const override { return 1; }
    const Mesh* mesh;
    lattice::Lattice lattice;
    int& count;
  };

  SimulatedDevice(Time& time, double its_latency, double its_speed)
      : latency(its_latency), faster(its_speed), time_(time) {}

  OracleKind kind() const override { return OracleKind::kCompute; }
  std::shared_ptr<const DeviceResource> makeResident(const Surface& surface) override {
    time_.now += latency + 1e-8 * static_cast<double>(surface.triangle_count);
    ++uploads;
    return has_room ? std::make_shared<Resource>(surface, resources) : nullptr;
  }
  void submit(std::vector<ExpansionRequest>& batch) override {
    if (is_lost) return;
    for (const ExpansionRequest& e : batch) {
      const auto* const its = static_cast<const Resource*>(e.surface->device.get());
      ASSERT_NE(its, nullptr) << "a mesh that the device does not have";
      EXPECT_EQ(its->mesh, e.surface->mesh.get());
      EXPECT_TRUE(its->lattice == e.surface->lattice);
      EXPECT_EQ(e.ids_up_to, ExpansionRequest::kAll);
    }
    if (answers) CpuOracle::submit(batch);
    ready_ = std::max(time_.now, ready_) + latency + Rates().of(batch) / faster;
    cells += batch.size();
    ++batches;
  }
  // As oracles on a device do it: what a lost one leaves is the CPU's.
  void wait(std::vector<ExpansionRequest>& batch) override {
    if (throws) throw std::bad_alloc();
    if (is_lost) {
      if (!loss_is_known_) time_.now += 10;
      loss_is_known_ = true;
      if (answers) CpuOracle::submit(batch);
      time_.now += Rates().of(batch);
      ++batches;
      return;
    }
    time_.now = std::max(time_.now, ready_);
  }

  double latency, faster;
  bool has_room = true, is_lost = false, answers = true, throws = false;
  std::size_t cells = 0, batches = 0, uploads = 0;
  int resources = 0;  // that somebody holds

 private:
  Time& time_;
  double ready_ = 0;
  bool loss_is_known_ = false;
};

// All batches of a surface, a level each, and the lists that they are about.
struct Levels {
  explicit Levels(const Surface& on, int most) : surface(on) {
    CpuOracle cpu;
    std::vector<ExpansionRequest> level{rootOf(surface)};
    for (int l = 1; l <= most; ++l) {
      lists.emplace_back();
      std::vector<ExpansionRequest> next;
      for (const ExpansionRequest& e : ask(cpu, level)) {
        for (std::size_t o = 0; o < 8; ++o) {
          if ((e.grey >> o & 1) == 0) continue;
          lists.back().emplace_back(e.listBegin(static_cast<int>(o)), e.listEnd(static_cast<int>(o)));
          next.push_back(rootOf(surface));
          next.back().cell = e.cell.octant(static_cast<int>(o));
          next.back().ids = lists.back().back().data();
          next.back().count = lists.back().back().size();
        }
      }
      all.push_back(level);
      level = next;
    }
  }
  Surface surface;
  std::vector<Lists> lists;
  std::vector<std::vector<ExpansionRequest>> all;
};

// What a query asks for: some nodes of one level.
std::vector<ExpansionRequest> some(const Levels& levels, std::size_t level, std::size_t count, std::mt19937_64& g) {
  const std::vector<ExpansionRequest>& all = levels.all[level];
  std::vector<ExpansionRequest> batch;
  for (std::size_t i = g() % all.size(), n = std::min(count, all.size()); n > 0; --n) {
    batch.push_back(all[i]);
    i = (i + 7919) % all.size();
  }
  return batch;
}

void expectSameAnswers(const std::vector<ExpansionRequest>& asked, const std::vector<ExpansionRequest>& answers) {
  CpuOracle cpu;
  const std::vector<ExpansionRequest> expected = ask(cpu, asked);
  for (std::size_t i = 0; i < asked.size(); ++i) {
    EXPECT_EQ(answers[i].grey, expected[i].grey);
    EXPECT_EQ(answers[i].surface, asked[i].surface);
    EXPECT_EQ(answers[i].on_device, 0) << "the host has all lists";
    // An order is not promised.
    for (std::size_t o = 0; o < 8; ++o) {
      const auto sorted = [o](const ExpansionRequest& e) {
        std::vector<std::uint32_t> ids(e.listBegin(static_cast<int>(o)), e.listEnd(static_cast<int>(o)));
        std::sort(ids.begin(), ids.end());
        return ids;
      };
      EXPECT_EQ(sorted(answers[i]), sorted(expected[i]));
    }
  }
}

// In batches that mix nodes of two surfaces.
void expectSameAnswersOfBoth(Oracle& oracle, const Levels& a, const Levels& b) {
  std::mt19937_64 g(5);
  for (int i = 0; i < 100; ++i) {
    std::vector<ExpansionRequest> batch = some(a, 1 + g() % 5, 1 + g() % 400, g);
    for (const ExpansionRequest& e : some(b, g() % 6, g() % 100, g)) batch.push_back(e);
    std::shuffle(batch.begin(), batch.end(), g);
    expectSameAnswers(batch, ask(oracle, batch));
  }
}

enum class Job { kPath, kLarge, kMixed };

// A host and a device on one clock.
struct Simulation {
  Simulation(double latency, double faster)
      : host(std::make_shared<SimulatedHost>(time)), device(std::make_shared<SimulatedDevice>(time, latency, faster)) {}

  // How long a job takes: growth along a path (1 to 8 nodes a batch), large batches, or both in turns.
  double secondsOf(Oracle& oracle, const Levels& levels, Job job) {
    host->answers = device->answers = false;
    std::mt19937_64 g(3);
    const double begin = time.now;
    for (int i = 0; i < (job == Job::kLarge ? 50 : 200); ++i) {
      const bool is_large = job == Job::kLarge || (job == Job::kMixed && i % 8 == 0);
      const std::size_t level = is_large ? levels.all.size() - 1 : 2 + g() % 3;
      auto batch = some(levels, level, is_large ? 2000 : 1 + g() % 8, g);
      for (ExpansionRequest& e : batch) e.surface = &levels.surface;
      ask(oracle, std::move(batch));
    }
    host->answers = device->answers = true;
    return time.now - begin;
  }

  Time time;
  std::shared_ptr<SimulatedHost> host;
  std::shared_ptr<SimulatedDevice> device;
};

TEST(AutoOracle, IsAsGoodAsTheBetterOnAnyDevice) {
  const Levels levels(surfaceOf(test::torus(64)), 7);
  Levels there(levels.surface, 7);
  int resources = 0;
  there.surface.device = std::make_shared<SimulatedDevice::Resource>(there.surface, resources);
  for (auto& level : there.all) {
    for (ExpansionRequest& e : level) e.ids_up_to = ExpansionRequest::kAll;
  }
  std::printf("simulated: latency, times the CPU's rate: CPU alone, device alone, kAuto in ms; path | large | mixed\n");
  for (const double latency : {0.0, 20e-6, 100e-6, 1e-3, 10e-3}) {
    for (const double faster : {0.1, 1.0, 10.0, 100.0}) {
      if (test::kSanitized && latency > 0 && latency != 100e-6) continue;
      std::printf("%6.2f ms %5.1f:", 1e3 * latency, faster);
      for (const Job job : {Job::kPath, Job::kLarge, Job::kMixed}) {
        Simulation simulated(latency, faster);
        auto& [time, host, device] = simulated;
        const double alone = simulated.secondsOf(*host, levels, job);
        const double on_device = simulated.secondsOf(*device, there, job);
        AutoOracle both(host, device, time.clock());
        const double seconds = simulated.secondsOf(both, levels, job);
        const double better = std::min(alone, on_device);
        std::printf(" %8.1f %8.1f %8.1f |", 1e3 * alone, 1e3 * on_device, 1e3 * seconds);
        // 0.5 ms: the mesh comes to the device when the host was asked for as long.
        EXPECT_LE(seconds, 1.1 * better + 5e-4) << "latency " << latency << ", rate " << faster;
        if (job == Job::kMixed && latency == 100e-6 && faster >= 1) {
          EXPECT_LT(seconds, 0.95 * better);
        }
      }
      std::printf("\n");
    }
  }
}

TEST(AutoOracle, AnswersAreTheSameWhoeverGivesThem) {
  const Levels a(surfaceOf(test::torus(40)), 6), b(surfaceOf(test::soup(500, 2)), 6);
  for (const double latency : {0.0, 100e-6}) {
    Simulation simulated(latency, 3);
    auto& [time, host, device] = simulated;
    AutoOracle both(host, device, time.clock());
    host->cells = device->cells = 0;
    expectSameAnswersOfBoth(both, a, b);
    EXPECT_GT(host->cells, 0u);
    EXPECT_GT(device->cells, 0u);
    EXPECT_EQ(device->uploads, 3u + 2u) << "each mesh once";
  }
}

// Two models may share a mesh and divide it in different ways. What the device has is in the units of one lattice.
TEST(AutoOracle, AMeshOnTwoLatticesIsUploadedForEach) {
  const Surface surface = surfaceOf(test::torus(40));
  const Levels a(surface, 6), b({surface.mesh, lattice::Lattice(surface.mesh->bounds(), Subdivision::kOctree, 0)}, 6);
  ASSERT_FALSE(a.surface.lattice == b.surface.lattice);
  Simulation simulated(0, 3);
  auto& [time, host, device] = simulated;
  AutoOracle both(host, device, time.clock());
  device->cells = device->uploads = 0;
  expectSameAnswersOfBoth(both, a, b);
  EXPECT_GT(device->cells, 0u);
  EXPECT_EQ(device->uploads, 2u);
}

// Neither the host nor the device has memory. The next batch at the same address is another one.
TEST(AutoOracle, AnExceptionLeavesNoBatchBehind) {
  const Levels levels(surfaceOf(test::torus(64)), 7);
  Simulation simulated(20e-6, 2);
  auto& [time, host, device] = simulated;
  AutoOracle both(host, device, time.clock());
  for (int k = 0; k < 5; ++k) ask(both, levels.all[5]);
  std::vector<ExpansionRequest> batch = levels.all[5];
  // The device gets the largest, so it has the first ones.
  std::sort(batch.begin(), batch.end(), [](const auto& x, const auto& y) { return x.count > y.count; });
  host->throws = device->throws = true;
  EXPECT_THROW(both.submit(batch), std::bad_alloc);
  host->throws = device->throws = false;
  // So few that the host answers them.
  const std::vector<ExpansionRequest> next(levels.all[3].begin(), levels.all[3].begin() + 3);
  batch.assign(next.begin(), next.end());
  both.submit(batch);
  both.wait(batch);
  expectSameAnswers(next, batch);
}

TEST(AutoOracle, ADeviceThatSlowsDownIsLeftAndFoundAgain) {
  const Levels levels(surfaceOf(test::torus(64)), 7);
  Simulation simulated(50e-6, 20);
  auto& [time, host, device] = simulated;
  const double alone = simulated.secondsOf(*host, levels, Job::kLarge);
  AutoOracle both(host, device, time.clock());
  const double fast = simulated.secondsOf(both, levels, Job::kLarge);
  EXPECT_LT(fast, 0.2 * alone);
  device->faster = 0.5;  // something else computes there
  EXPECT_LT(simulated.secondsOf(both, levels, Job::kLarge), 1.1 * alone);
  device->faster = 20;
  simulated.secondsOf(both, levels, Job::kLarge);
  EXPECT_LT(simulated.secondsOf(both, levels, Job::kLarge), 1.5 * fast);
}

TEST(AutoOracle, ALostDeviceIsNotAskedAgain) {
  const Levels levels(surfaceOf(test::torus(64)), 7);
  Simulation simulated(50e-6, 20);
  auto& [time, host, device] = simulated;
  AutoOracle both(host, device, time.clock());
  simulated.secondsOf(both, levels, Job::kLarge);
  device->is_lost = true;
  std::mt19937_64 g(7);
  const std::vector<ExpansionRequest> batch = some(levels, 6, 1000, g);
  expectSameAnswers(batch, ask(both, batch));
  simulated.secondsOf(both, levels, Job::kLarge);
  device->batches = 0;
  simulated.secondsOf(both, levels, Job::kLarge);
  EXPECT_LT(device->batches, 5u) << "of 50: a trial now and then";
}

TEST(AutoOracle, WhatTheDeviceCannotTakeIsTheHosts) {
  const Levels levels(surfaceOf(test::torus(64)), 7);
  Simulation simulated(50e-6, 20);
  auto& [time, host, device] = simulated;
  AutoOracle both(host, device, time.clock());
  device->has_room = false;
  device->cells = device->uploads = 0;
  simulated.secondsOf(both, levels, Job::kLarge);
  EXPECT_EQ(device->cells, 0u);
  EXPECT_EQ(device->uploads, 1u) << "it is not asked to take it again";

  AutoOracle never(host, device, time.clock());
  expectSameAnswers(levels.all[5], ask(never, levels.all[5]));
  EXPECT_EQ(device->cells, 0u);
}

// A mesh at the address of one that is gone is another mesh.
TEST(AutoOracle, MeshesComeAndGo) {
  Simulation simulated(50e-6, 20);
  auto& [time, host, device] = simulated;
  AutoOracle both(host, device, time.clock());
  for (int i = 0; i < 40; ++i) {
    const Levels levels(surfaceOf(test::torus(24 + static_cast<std::size_t>(i) % 3)), 5);
    device->uploads = 0;
    host->answers = device->answers = false;
    for (int k = 0; k < 20; ++k) ask(both, levels.all[4]);
    host->answers = device->answers = true;
    expectSameAnswers(levels.all[4], ask(both, levels.all[4]));
    EXPECT_EQ(device->uploads, 1u);
    EXPECT_LT(device->resources, 12) << "those of meshes that are gone go";
  }
}

// Many poses: pairs of trees are walked by whoever takes less time. A pair takes the host 4 us.
struct Walks {
  explicit Walks(bool is_hardware, double its_pair) : choice(is_hardware), pair(its_pair) {}
  void run(int count) {
    constexpr std::size_t kPairs = 1000;
    for (int i = 0; i < count; ++i) {
      const bool there = choice.takesDevice(kPairs);
      const double took = kPairs * (there ? pair : 4e-6);
      choice.learn(kPairs, took, !there);
      seconds += took;
      by_device += there;
    }
  }
  PairsChoice choice;
  double pair, seconds = 0;  // of the device, in seconds
  int by_device = 0;
};

TEST(PairsChoice, TakesWhatIsFaster) {
  Walks fast(true, 2e-7);
  fast.run(200);
  EXPECT_EQ(fast.by_device, 200);
  // A device that turns out to be slow is tried now and then.
  Walks slow(true, 1.2e-5);
  slow.run(300);
  EXPECT_LT(slow.seconds, 1.1 * 300 * 1000 * 4e-6);
  slow.pair = 2e-7;
  slow.by_device = 0;
  slow.run(1000);
  EXPECT_GT(slow.by_device, 500) << "it became fast";
  Walks software(false, 4e-4);
  software.run(1000);
  EXPECT_EQ(software.by_device, 0);
}

TEST(AutoOracle, ThreadsShareTheDevice) {
  const Levels levels(surfaceOf(test::torus(40)), 6);
  const auto thread = std::make_shared<gl::Thread>(gl::ContextRequest());
  const auto compute = std::make_shared<gl::ComputeOracle>(thread);
  AutoOracle both(std::make_shared<CpuOracle>(), compute);
  test::ThreadGroup(4, [&](std::size_t k) {
    std::mt19937_64 g(k);
    for (int i = 0; i < 20; ++i) {
      const auto batch = some(levels, 1 + g() % 5, 1 + g() % 300, g);
      expectSameAnswers(batch, ask(both, batch));
    }
  });
  EXPECT_EQ(compute->leftToCpu(), 0u);
}

}  // namespace
}  // namespace bocst::oracle
