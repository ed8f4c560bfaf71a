// SPDX-License-Identifier: BSD-3-Clause
#include "oracle/gl/self_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <numeric>
#include <utility>
#include <vector>

#include "bounds/cell_frame.h"
#include "oracle/cpu/cpu_oracle.h"
#include "oracle/gl/known_pairs.h"
#include "oracle/reference.h"

namespace bocst::oracle::gl {
namespace {

using Ids = std::vector<std::uint32_t>;

// A ball with waves: triangles of all directions, smaller towards the poles.
std::shared_ptr<const Mesh> ball() {
  constexpr int kRings = 14, kSides = 20;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> triangles;
  for (int i = 0; i <= kRings; ++i) {
    for (int j = 0; j < kSides; ++j) {
      const double a = M_PI * (i + 0.3) / (kRings + 0.6), b = 2 * M_PI * j / kSides;
      const double r = 1 + 0.2 * std::sin(5 * b) * std::sin(3 * a);
      vertices.emplace_back(r * std::sin(a) * std::cos(b), 1.3 * r * std::sin(a) * std::sin(b), 0.7 * r * std::cos(a));
      if (i == kRings) continue;
      const auto at = [j](int ring, int side) {
        return static_cast<std::uint32_t>(ring * kSides + (j + side) % kSides);
      };
      triangles.push_back({at(i, 0), at(i, 1), at(i + 1, 0)});
      triangles.push_back({at(i + 1, 0), at(i, 1), at(i + 1, 1)});
    }
  }
  return Mesh::fromIndices(std::move(vertices), std::move(triangles));
}

// Triangles that meet all octants of the root.
std::shared_ptr<const Mesh> star() {
  constexpr int kRays = 64;
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Mesh::Indices> triangles;
  for (int i = 0; i < kRays; ++i) {
    const double a = 0.1 + 0.37 * i;
    const Eigen::Vector3d p(std::cos(a), std::sin(a), std::sin(1.7 * a)), q(std::sin(2.3 * a), std::cos(a), -p[2]);
    for (const Eigen::Vector3d& v : {p, Eigen::Vector3d(-p), q}) vertices.push_back(v);
    triangles.push_back({static_cast<std::uint32_t>(3 * i), static_cast<std::uint32_t>(3 * i + 1),
                         static_cast<std::uint32_t>(3 * i + 2)});
  }
  return Mesh::fromIndices(std::move(vertices), std::move(triangles));
}

// A question, and what is known of its answer.
struct Question {
  const Surface* surface;
  lattice::Cell cell;
  Ids ids;
};

ExpansionRequest requestFor(const Question& question) {
  ExpansionRequest e;
  e.surface = question.surface;
  e.cell = question.cell;
  e.ids = question.ids.data();
  e.count = question.ids.size();
  return e;
}

// Those of the ids that meet the octant, by the reference test.
Ids meeting(const Surface& surface, const Ids& ids, const lattice::Cell& octant) {
  Ids met;
  if (!surface.lattice.exists(octant)) return met;
  for (const std::uint32_t t : ids) {
    if (triangleMeetsCube(surface.corners(t).data(), centerOf(octant), octant.side() / 2.0)) met.push_back(t);
  }
  return met;
}

bool holds(const bounds::NodeBounds& b, const lattice::Cell& cell, const Eigen::Vector3d& p) {
  const auto corner = cell.corner();
  const bounds::CellFrame frame{{double(corner[0]), double(corner[1]), double(corner[2])}, double(cell.side())};
  const bounds::Volume v = frame.decode(b);
  const double tolerance = 1e-4 * frame.side;
  double along = -static_cast<double>(v.slab_offset);
  for (std::size_t k = 0; k < 3; ++k) {
    const double d = p[static_cast<int>(k)] - v.center[k];
    if (std::abs(d) > static_cast<double>(v.half[k]) + tolerance) return false;
    along += static_cast<double>(v.normal[k]) * d;
  }
  return !b.hasSlab() || std::abs(along) <= static_cast<double>(v.slab_half) + tolerance;
}

// Points of the triangle in the octant must be within its bounds.
bool areBounded(const Surface& surface, std::uint32_t t, const bounds::NodeBounds& b, const lattice::Cell& octant) {
  const auto c = surface.corners(t);
  constexpr int kSteps = 6;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const Eigen::Vector3d p = c[0] + (c[1] - c[0]) * (double(i) / kSteps) + (c[2] - c[0]) * (double(j) / kSteps);
      if ((p - centerOf(octant)).cwiseAbs().maxCoeff() <= octant.side() / 2.0 && !holds(b, octant, p)) return false;
    }
  }
  return true;
}

// Compares answers with what the CPU knows; `lists`: of each octant, wherever they were.
std::string compare(const Question& question, const ExpansionRequest& e, const std::vector<Ids>& lists) {
  const std::string where = " at level " + std::to_string(question.cell.level);
  const Surface& surface = *question.surface;
  for (int o = 0; o < 8; ++o) {
    const lattice::Cell octant = question.cell.octant(o);
    Ids expected = meeting(surface, question.ids, octant);
    std::sort(expected.begin(), expected.end());
    Ids found = lists[static_cast<std::size_t>(o)];
    if ((e.grey >> o & 1) != !expected.empty())
      return (expected.empty() ? "an octant too many" : "an octant is lost") + where;
    std::sort(found.begin(), found.end());
    if (!std::includes(found.begin(), found.end(), expected.begin(), expected.end()))
      return "a triangle is lost" + where;
    if (found.size() > 2 * expected.size() + 8) return "triangles too many" + where;
    const bounds::NodeBounds b = e.octants.get(static_cast<std::size_t>(o));
    for (const std::uint32_t t : expected) {
      if (!areBounded(surface, t, b, octant)) return "bounds that do not hold the surface" + where;
    }
  }
  return "";
}

std::vector<Ids> listsOf(const ExpansionRequest& e) {
  std::vector<Ids> lists;
  for (int o = 0; o < 8; ++o) lists.emplace_back(e.listBegin(o), e.listEnd(o));
  return lists;
}

// Asks all in one batch, with lists that come back.
std::string askAll(ComputeOracle& oracle, const std::vector<Question>& questions) {
  std::vector<ExpansionRequest> batch;
  for (const Question& q : questions) batch.push_back(requestFor(q));
  const std::uint64_t left = oracle.leftToCpu();
  oracle.submit(batch);
  oracle.wait(batch);
  if (oracle.leftToCpu() != left) return "a batch was not answered";
  for (std::size_t i = 0; i < batch.size(); ++i) {
    const std::string wrong = compare(questions[i], batch[i], listsOf(batch[i]));
    if (!wrong.empty()) return wrong;
  }
  return "";
}

// Roots and some of their octants, with lists that stay on the device.
std::string askKept(ComputeOracle& oracle, std::vector<Question> questions) {
  std::vector<ExpansionRequest> batch;
  for (const Question& root : questions) batch.push_back(requestFor(root));
  for (int level = 0; level < 2; ++level) {
    for (ExpansionRequest& e : batch) e.ids_up_to = 0;
    const std::uint64_t left = oracle.leftToCpu();
    oracle.submit(batch);
    oracle.wait(batch);
    if (oracle.leftToCpu() != left) return "a batch with lists of its own was not answered";
    std::vector<ExpansionRequest> children;
    std::vector<Question> next;
    for (std::size_t i = 0; i < batch.size(); ++i) {
      std::vector<Ids> lists(8);
      for (std::size_t o = 0; o < 8; ++o) {
        const ExpansionRequest::DeviceList kept = batch[i].deviceList(static_cast<int>(o));
        lists[o].resize(kept.count);
        if (kept.count == 0) continue;
        if (!oracle.fetch(*batch[i].deviceLists(), kept, lists[o].data())) return "a list was lost";
        if (o % 3 != 0) continue;
        next.push_back({questions[i].surface, questions[i].cell.octant(static_cast<int>(o)), lists[o]});
        ExpansionRequest child;
        child.surface = next.back().surface;
        child.cell = next.back().cell;
        child.resource = batch[i].deviceLists();
        child.resource_begin = kept.begin;
        child.count = kept.count;
        children.push_back(child);
      }
      const std::string wrong = compare(questions[i], batch[i], lists);
      if (!wrong.empty()) return wrong;
    }
    batch.swap(children);
    questions.swap(next);
  }
  return "";
}

Ids allOf(const Surface& surface) {
  Ids ids(surface.triangle_count);
  std::iota(ids.begin(), ids.end(), 0u);
  return ids;
}

// Cells of a level about some corners of triangles, asked about all triangles that meet them.
std::vector<Question> deepQuestions(const Surface& surface, int level) {
  const Ids all = allOf(surface);
  std::vector<Question> questions;
  for (std::uint32_t t = 0; t < surface.triangle_count;
       t += 1 + static_cast<std::uint32_t>(surface.triangle_count) / 6) {
    const Eigen::Vector3d p = surface.corner(t, static_cast<int>(t % 3));
    lattice::Cell cell;
    cell.level = level;
    for (int k = 0; k < 3; ++k) {
      const double most = (1 << (level - 1)) - 1;
      cell.at[static_cast<std::size_t>(k)] =
          static_cast<std::uint32_t>(std::min(std::max(p[k] / cell.side(), 0.0), most));
    }
    const Ids ids = meeting(surface, all, cell);
    if (!ids.empty()) questions.push_back({&surface, cell, ids});
  }
  return questions;
}

// Triangles that pass a face or an edge of an octant by less than float can tell, each with a cell that has the octant.
// A device whose doubles are not quite doubles is wrong about half of them.
struct Grazing {
  std::shared_ptr<const Mesh> mesh;
  std::vector<lattice::Cell> cells;  // of triangle kFirst + i
  static constexpr std::uint32_t kFirst = 2;
};

Grazing grazing() {
  constexpr int kCount = 48;
  constexpr double kWhole = 2 * lattice::kMiddle;
  std::uint32_t state = 1;
  const auto random = [&state] {  // 0 to 1
    state = 1664525 * state + 1013904223;
    return static_cast<double>(state >> 8) / (1 << 24);
  };
  Grazing g;
  // Two points make the lattice's unit that of the coordinates.
  std::vector<Eigen::Vector3d> vertices{Eigen::Vector3d::Zero(), Eigen::Vector3d::Constant(kWhole)};
  std::vector<Mesh::Indices> triangles{{0, 0, 0}, {1, 1, 1}};
  for (int i = 0; i < kCount; ++i) {
    lattice::Cell cell;
    cell.level = 1 + i % 12;
    for (std::uint32_t& at : cell.at) at = static_cast<std::uint32_t>(random() * (1 << (cell.level - 1)));
    const double side = cell.side(), off = (i % 4 < 2 ? side : -side) * std::pow(10.0, -7 - 3 * random());
    const Eigen::Vector3d middle = centerOf(cell);
    Eigen::Vector3d p[3];
    for (Eigen::Vector3d& v : p) v = middle + side * Eigen::Vector3d(random() - 0.5, random() - 0.5, random() - 0.5);
    const int axis = i / 4 % 3;
    if (i % 2 == 0) {
      for (Eigen::Vector3d& v : p) v[axis] = middle[axis] + off;  // in a plane beside the middle one
    } else {
      // The middle of its first edge beside the middle line along the axis.
      Eigen::Vector3d shift = middle - (p[0] + p[1]) / 2;
      for (int k = 0; k < 3; ++k) shift[k] = k == axis ? 0 : shift[k] + off;
      for (Eigen::Vector3d& v : p) v = (v + shift).cwiseMax(0.0).cwiseMin(kWhole);
    }
    const auto first = static_cast<std::uint32_t>(vertices.size());
    vertices.insert(vertices.end(), std::begin(p), std::end(p));
    triangles.push_back({first, first + 1, first + 2});
    g.cells.push_back(cell);
  }
  g.mesh = Mesh::fromIndices(std::move(vertices), std::move(triangles));
  return g;
}

struct Meshes {
  Surface ball, star, grazing;
  std::vector<lattice::Cell> grazed;
};

Surface onHost(std::shared_ptr<const Mesh> mesh) {
  const lattice::Lattice lattice(mesh->bounds(), Subdivision::kBono, 0);
  return {std::move(mesh), lattice};
}

// All on the device. Empty where it has no room.
std::unique_ptr<Meshes> residentOn(DeviceOracle& oracle) {
  const auto surfaceOf = [&](std::shared_ptr<const Mesh> mesh) {
    Surface surface = onHost(std::move(mesh));
    surface.device = oracle.makeResident(surface);
    return surface;
  };
  const Grazing g = grazing();
  auto meshes = std::make_unique<Meshes>(Meshes{surfaceOf(ball()), surfaceOf(star()), surfaceOf(g.mesh), g.cells});
  for (const Surface* surface : {&meshes->ball, &meshes->star, &meshes->grazing}) {
    if (surface->device == nullptr) return nullptr;
  }
  return meshes;
}

std::vector<std::vector<Question>> batchesOf(const Meshes& meshes) {
  const Question of_ball{&meshes.ball, lattice::Cell{}, allOf(meshes.ball)},
      of_star{&meshes.star, lattice::Cell{}, allOf(meshes.star)};
  std::vector<std::vector<Question>> batches = {{of_ball, of_star}, {of_star, of_ball}};
  batches.emplace_back();
  for (int o = 0; o < 8; ++o) {
    for (const Question& q : {of_ball, of_star}) {
      if (o % (q.surface == &meshes.star ? 3 : 2) != 0) continue;
      batches.back().push_back({q.surface, q.cell.octant(o), meeting(*q.surface, q.ids, q.cell.octant(o))});
    }
  }
  batches.emplace_back();
  for (std::uint32_t i = 0; i < meshes.grazed.size(); ++i) {
    batches.back().push_back({&meshes.grazing, meshes.grazed[i], {Grazing::kFirst + i}});
  }
  for (const auto& levels : {std::array{9, 14}, std::array{15, 16}}) {
    batches.emplace_back();
    for (const int level : levels) {
      for (const Surface* surface : {&meshes.ball, &meshes.star}) {
        const std::vector<Question> questions = deepQuestions(*surface, level);
        batches.back().insert(batches.back().end(), questions.begin(), questions.end());
      }
    }
  }
  return batches;
}

}  // namespace

std::string selfTest(ComputeOracle& oracle) {
  const std::unique_ptr<Meshes> meshes = residentOn(oracle);
  if (meshes == nullptr) return "it takes no mesh";
  for (const std::vector<Question>& batch : batchesOf(*meshes)) {
    const std::string wrong = askAll(oracle, batch);
    if (!wrong.empty()) return wrong;
  }
  // All triangles of the star in all octants: more than the room that is first taken.
  return askKept(oracle, {{&meshes->star, lattice::Cell{}, allOf(meshes->star)},
                          {&meshes->ball, lattice::Cell{}, allOf(meshes->ball)}});
}

std::string selfTestOfWalks(ComputeOracle& oracle) { return KnownPairs(onHost(ball()), onHost(star())).ask(oracle); }

std::string selfTest(OcclusionOracle& oracle) {
  const std::unique_ptr<Meshes> meshes = residentOn(oracle);
  if (meshes == nullptr) return "it takes no mesh";
  for (const std::vector<Question>& questions : batchesOf(*meshes)) {
    std::vector<ExpansionRequest> batch;
    std::vector<ExpansionRequest*> requests;
    for (const Question& q : questions) batch.push_back(requestFor(q));
    for (ExpansionRequest& e : batch) requests.push_back(&e);
    const std::vector<std::uint8_t> candidates = oracle.candidates(requests);
    std::size_t asked = 0, seen = 0;
    for (std::size_t i = 0; i < questions.size(); ++i) {
      for (int o = 0; o < 8; ++o) {
        const lattice::Cell octant = questions[i].cell.octant(o);
        const bool is_seen = (candidates[i] >> o & 1) != 0;
        asked += questions[i].surface->lattice.exists(octant);
        seen += is_seen;
        if (is_seen || meeting(*questions[i].surface, questions[i].ids, octant).empty()) continue;
        return "an octant is lost at level " + std::to_string(octant.level);
      }
    }
    // A device that sees something everywhere is right, but of no use.
    if (questions.front().cell.level > 9 && seen == asked) return "it sees surface where none is";
  }
  return "";
}

}  // namespace bocst::oracle::gl
