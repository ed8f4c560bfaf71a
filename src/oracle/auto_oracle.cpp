// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/auto_oracle.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>
#include <utility>

#include "log/assert.h"
#include "thread/of_thread.h"

namespace bocst::oracle {
namespace {

// Before anything is measured: one core of a desktop machine, and a GPU beside it (share/doc/oracles.md).
constexpr CostModel kHost{1e-7, 1e-6, 4e-8}, kDevice{1e-4, 4e-7, 2e-9}, kUpload{1e-4, 0, 2e-8};

// The host's part should end before the device's: only if the host has to wait does the elapsed time measure the
// device.
constexpr double kHostEarlier = 0.8;

// The time to split a batch and to join its parts again, in seconds per cell.
constexpr double kMoving = 1.5e-7;

// A surface with hills, and triangles of many sizes.
Surface hills() {
  constexpr std::uint32_t kSide = 64;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> triangles;
  for (std::uint32_t y = 0; y <= kSide; ++y) {
    for (std::uint32_t x = 0; x <= kSide; ++x) {
      const double u = std::pow(x / double{kSide}, 1.5), v = y / double{kSide};
      vertices.emplace_back(u, v, 0.2 * std::sin(9 * u) * std::cos(11 * v));
      if (x == kSide || y == kSide) continue;
      const std::uint32_t at = y * (kSide + 1) + x;
      triangles.push_back({at, at + 1, at + kSide + 1});
      triangles.push_back({at + 1, at + kSide + 2, at + kSide + 1});
    }
  }
  auto mesh = Mesh::fromIndices(std::move(vertices), std::move(triangles));
  const lattice::Lattice lattice(mesh->bounds(), Subdivision::kBono, 0);
  return {std::move(mesh), lattice};
}

}  // namespace

double AutoOracle::steadySeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

void AutoOracle::Work::add(const ExpansionRequest& e) {
  ++cells;
  triangles += static_cast<double>(e.count);
}

AutoOracle::AutoOracle(std::shared_ptr<Oracle> host, std::shared_ptr<Oracle> device, Seconds clock)
    : host_(std::move(host)),
      device_(std::move(device)),
      clock_(std::move(clock)),
      host_cost_(kHost),
      device_cost_(kDevice),
      upload_cost_(kUpload) {
  measure();
}

// Each level of a small tree, asked of both.
void AutoOracle::measure() {
  constexpr int kRounds = 3, kLevels = 6;
  Surface surface = hills();
  for (int round = 0; round < kRounds; ++round) {
    surface.device = nullptr;
    double begin = clock_();
    surface.device = device_->makeResident(surface);
    if (surface.device == nullptr) {
      device_cost_.batch = std::numeric_limits<double>::infinity();  // it takes nothing
      return;
    }
    upload_cost_.learn(0, static_cast<double>(surface.triangle_count), clock_() - begin);
    ExpansionRequest root;
    root.surface = &surface;
    root.count = surface.triangle_count;
    std::vector<ExpansionRequest> level{root}, next;
    std::vector<std::vector<std::uint32_t>> lists, next_lists;
    for (int l = 1; l <= kLevels; ++l) {
      Work work;
      for (const ExpansionRequest& e : level) work.add(e);
      const auto timed = [&](Oracle& oracle, CostModel& cost) {
        std::vector<ExpansionRequest> answers = level;
        begin = clock_();
        oracle.submit(answers);
        oracle.wait(answers);
        cost.learn(work.cells, work.triangles, clock_() - begin);
        return answers;
      };
      timed(*device_, device_cost_);
      next.clear();
      next_lists.clear();
      for (const ExpansionRequest& e : timed(*host_, host_cost_)) {
        for (int o = 0; o < 8; ++o) {
          if ((e.grey >> o & 1) == 0) continue;
          next_lists.emplace_back(e.listBegin(o), e.listEnd(o));
          next.push_back(root);
          next.back().cell = e.cell.octant(o);
          next.back().ids = next_lists.back().data();
          next.back().count = next_lists.back().size();
        }
      }
      level.swap(next);
      lists.swap(next_lists);
    }
  }
}

// What the device should answer while the host answers the rest, at least `least`. In the order of the candidates,
// which come by how much sooner the device is done with them.
AutoOracle::Share AutoOracle::bestShare(const Work& batch, const std::vector<Candidate>& candidates,
                                        std::size_t least) const {
  Share share;
  const double alone = host_cost_.of(batch.cells, batch.triangles), moving = kMoving * batch.cells;
  share.seconds = least == 0 ? Trials::kWorthwhile * alone : std::numeric_limits<double>::infinity();
  double here = alone, there = device_cost_.batch;
  for (std::size_t n = 1; n <= candidates.size(); ++n) {
    const auto triangles = static_cast<double>(candidates[n - 1].triangles);
    here -= host_cost_.cell + host_cost_.triangle * triangles;
    there += device_cost_.cell + device_cost_.triangle * triangles;
    if (there >= share.seconds) break;
    const bool is_all = static_cast<double>(n) == batch.cells;
    const double both = is_all ? there : std::max(here / kHostEarlier, there) + moving;
    if (n < least || both >= share.seconds) continue;
    share.count = n;
    share.seconds = both;
  }
  return share;
}

// True if the device is faster than the host, and faster alone than both together can be. In a second, the host answers
// what takes the device at most `relief` seconds, so both together take at least 1 / (1 + relief) of the device's time.
bool AutoOracle::isAllForDevice(const Work& batch) const {
  const double here = host_cost_.of(batch.cells, batch.triangles),
               there = device_cost_.of(batch.cells, batch.triangles);
  const double relief = std::max(device_cost_.cell / host_cost_.cell, device_cost_.triangle / host_cost_.triangle);
  return there < Trials::kWorthwhile * here && there <= there / (1 + relief) + kMoving * batch.cells;
}

AutoOracle::Known& AutoOracle::known(const Surface& surface) {
  const auto [begin, end] = meshes_.equal_range(surface.mesh.get());
  for (auto i = begin; i != end; ++i) {
    Known& its = i->second;
    if (!(its.lattice == surface.lattice)) continue;
    if (its.mesh.lock() != surface.mesh) its = {surface.mesh, surface.lattice};  // a new mesh where another was
    return its;
  }
  return meshes_.insert({surface.mesh.get(), {surface.mesh, surface.lattice}})->second;
}

void AutoOracle::dropForgotten() {
  for (auto i = meshes_.begin(); i != meshes_.end();) i = i->second.mesh.expired() ? meshes_.erase(i) : std::next(i);
  live_meshes_ = meshes_.size();
}

void AutoOracle::upload(const Surface& surface, Known& its) {
  const double begin = clock_();
  its.device = device_->makeResident(surface);
  its.refused = its.device == nullptr;
  upload_cost_.learn(0, static_cast<double>(surface.triangle_count), clock_() - begin);
}

std::vector<AutoOracle::Candidate> AutoOracle::chooseShare(const std::vector<ExpansionRequest>& batch) {
  Work work;
  for (const ExpansionRequest& e : batch) work.add(e);
  const double alone = host_cost_.of(work.cells, work.triangles);
  trials_.earn(alone);
  if (!trials_.affords(device_cost_.batch, alone)) return {};

  if (meshes_.size() > 2 * live_meshes_ + 8) dropForgotten();
  std::vector<Candidate> candidates;
  candidates.reserve(batch.size());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const ExpansionRequest& e = batch[i];
    BOCST_ASSERT(e.surface->mesh != nullptr);  // this oracle makes nothing resident, so no mesh is released
    const bool is_next = !candidates.empty() && batch[candidates.back().place].surface == e.surface;
    Known* const its = is_next ? candidates.back().mesh : &known(*e.surface);
    if (!its->refused) candidates.push_back({e.count, i, its});
  }
  const auto is_away = [](const Candidate& c) { return c.mesh->device == nullptr; };
  if (candidates.size() == batch.size() && isAllForDevice(work) &&
      std::none_of(candidates.begin(), candidates.end(), is_away)) {
    return candidates;
  }
  const bool large_first =
      host_cost_.triangle * device_cost_.cell > host_cost_.cell * device_cost_.triangle;  // grows with the triangles
  std::sort(candidates.begin(), candidates.end(), [large_first](const Candidate& a, const Candidate& b) {
    return large_first ? a.triangles > b.triangles : a.triangles < b.triangles;
  });
  const Share wish = bestShare(work, candidates, 0);
  for (std::size_t n = 0; n < wish.count; ++n) {
    Known& its = *candidates[n].mesh;
    if (its.device != nullptr || its.refused) continue;
    its.saved += (alone - wish.seconds) / static_cast<double>(wish.count);
    const Surface& surface = *batch[candidates[n].place].surface;
    if (its.saved > upload_cost_.of(0, static_cast<double>(surface.triangle_count))) upload(surface, its);
  }
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_away), candidates.end());
  Share share = bestShare(work, candidates, 0);
  if (share.count == 0 && !candidates.empty()) {
    const Share trial = bestShare(work, candidates, 1);
    if (trials_.take(trial.seconds, alone)) share = trial;
  }
  candidates.resize(share.count);
  return candidates;
}

AutoOracle::Pending AutoOracle::makePending(std::vector<ExpansionRequest>& batch,
                                            const std::vector<Candidate>& share) const {
  Pending pending;
  pending.oracle = this;
  pending.batch = &batch;
  const bool is_part = share.size() < batch.size();
  for (const Candidate& candidate : share) {
    ExpansionRequest& e = batch[candidate.place];
    const auto has_same = [&](const auto& other) {
      return other->mesh == e.surface->mesh && other->lattice == e.surface->lattice;
    };
    auto found = std::find_if(pending.surfaces.begin(), pending.surfaces.end(), has_same);
    if (found == pending.surfaces.end()) {
      pending.surfaces.push_back(std::make_unique<Surface>(*e.surface));
      found = std::prev(pending.surfaces.end());
      (*found)->device = candidate.mesh->device;
    }
    pending.work.add(e);
    pending.places.push_back({candidate.place, e.surface, e.ids_up_to});
    e.surface = found->get();
    e.ids_up_to = ExpansionRequest::kAll;
    if (is_part) pending.part.push_back(std::move(e));
  }
  pending.expected = device_cost_.of(pending.work.cells, pending.work.triangles);
  return pending;
}

void AutoOracle::learn(CostModel& model, const Work& work, double seconds) {
  const std::unique_lock<std::mutex> lock(costs_mutex_, std::try_to_lock);
  if (lock.owns_lock()) model.learn(work.cells, work.triangles, seconds);
}

void AutoOracle::answerHere(std::vector<ExpansionRequest>& batch) {
  Work work;
  for (const ExpansionRequest& e : batch) work.add(e);
  const double begin = clock_();
  host_->submit(batch);
  host_->wait(batch);
  learn(host_cost_, work, clock_() - begin);
}

std::list<AutoOracle::Pending>& AutoOracle::pendingOfThread() { return thread::ofThread<std::list<Pending>>(); }

void AutoOracle::submit(std::vector<ExpansionRequest>& batch) {
  std::list<Pending> made;
  {
    const std::unique_lock<std::mutex> lock(costs_mutex_, std::try_to_lock);
    if (lock.owns_lock()) {
      const std::vector<Candidate> share = chooseShare(batch);
      if (!share.empty()) made.push_back(makePending(batch, share));
    }
  }
  if (made.empty()) {
    answerHere(batch);
    return;
  }
  // From here on the device may write to it, so it stays where it is.
  std::list<Pending>& all = pendingOfThread();
  all.splice(all.begin(), made);
  const auto place = all.begin();
  Pending& mine = *place;
  mine.begin = clock_();
  try {
    device_->submit(asked(mine, batch));
    if (mine.places.size() < batch.size()) answerRest(batch, mine);
  } catch (...) {
    std::list<Pending> ended;  // also if wait() throws
    ended.splice(ended.begin(), all, place);
    device_->wait(asked(mine, batch));
    throw;
  }
  mine.host_end = clock_();
}

void AutoOracle::answerRest(std::vector<ExpansionRequest>& batch, const Pending& pending) {
  std::vector<bool> is_asked(batch.size(), false);
  for (const Pending::Place& place : pending.places) is_asked[place.index] = true;
  std::vector<ExpansionRequest> rest;
  rest.reserve(batch.size() - pending.places.size());
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!is_asked[i]) rest.push_back(std::move(batch[i]));
  }
  answerHere(rest);
  auto next = rest.begin();
  for (std::size_t i = 0; i < batch.size(); ++i) {
    if (!is_asked[i]) batch[i] = std::move(*next++);
  }
}

void AutoOracle::wait(std::vector<ExpansionRequest>& batch) {
  std::list<Pending>& all = pendingOfThread();
  const auto mine =
      std::find_if(all.begin(), all.end(), [&](const Pending& p) { return p.oracle == this && p.batch == &batch; });
  if (mine == all.end()) return;
  std::list<Pending> ended;  // also if wait() throws
  ended.splice(ended.begin(), all, mine);
  device_->wait(asked(*mine, batch));
  const double now = clock_(), took = now - mine->begin;
  // If the host ended last, the device took less than this.
  if (now - mine->host_end > 0.05 * took || took < mine->expected) learn(device_cost_, mine->work, took);
  for (std::size_t i = 0; i < mine->places.size(); ++i) {
    const Pending::Place& place = mine->places[i];
    ExpansionRequest& e = batch[place.index];
    if (!mine->part.empty()) e = std::move(mine->part[i]);
    e.surface = place.surface;
    e.ids_up_to = place.ids_up_to;
  }
}

}  // namespace bocst::oracle
