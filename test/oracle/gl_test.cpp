// SPDX-License-Identifier: BSD-3-Clause
// What the oracles on a device add: lists that stay there, limits, losses, threads, and what occlusion queries see.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <string>

#include "egl/context.h"
#include "oracle/cpu/cpu_oracle.h"
#include "oracle/gl/compute_oracle.h"
#include "oracle/gl/devices.h"
#include "oracle/gl/occlusion_oracle.h"
#include "oracle/gl/self_test.h"
#include "surfaces.h"
#include "thread_group.h"

namespace bocst::oracle::gl {
namespace {

using lattice::Cell;

std::shared_ptr<Thread> newThread(int major = 4) {
  ContextRequest request;
  request.major = major;
  return std::make_shared<Thread>(request);
}

// All cells of a level that are grey, grown by the oracle itself from lists that it keeps.
std::vector<ExpansionRequest> grownFromKeptLists(Oracle& oracle, const Surface& surface, int levels) {
  std::vector<ExpansionRequest> level{rootOf(surface)};
  level[0].ids_up_to = 0;
  for (int l = 1; l < levels; ++l) {
    const std::vector<ExpansionRequest> answers = ask(oracle, level);
    level.clear();
    for (const ExpansionRequest& e : answers) {
      for (int o = 0; o < 8; ++o) {
        if ((e.grey >> o & 1) == 0) continue;
        ExpansionRequest child;
        child.surface = &surface;
        child.cell = e.cell.octant(o);
        child.resource = e.deviceLists();
        child.resource_begin = e.deviceList(o).begin;
        child.count = e.deviceList(o).count;
        child.ids_up_to = 0;
        EXPECT_GT(child.count, 0u);
        level.push_back(child);
      }
    }
  }
  return level;
}

std::set<std::uint64_t> greyCells(const std::vector<ExpansionRequest>& level) {
  std::set<std::uint64_t> cells;
  for (const ExpansionRequest& e : level) cells.insert(e.cell.morton());
  return cells;
}

std::set<std::uint64_t> greyCellsByReference(const Surface& surface, int level) {
  std::vector<Cell> cells{Cell{}}, next;
  for (int l = 1; l < level; ++l) {
    next.clear();
    for (const Cell& cell : cells) {
      for (int o = 0; o < 8; ++o) {
        if (referenceGrey(surface, cell.octant(o))) next.push_back(cell.octant(o));
      }
    }
    cells.swap(next);
  }
  std::set<std::uint64_t> names;
  for (const Cell& cell : cells) names.insert(cell.morton());
  return names;
}

TEST(Compute, GrowsFromListsThatItKeeps) {
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(16)));
  EXPECT_EQ(greyCells(grownFromKeptLists(oracle, surface, 5)), greyCellsByReference(surface, 5));
  EXPECT_EQ(oracle.leftToCpu(), 0u);
}

TEST(Compute, FetchesWhatItKeeps) {
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(16)));
  ExpansionRequest kept = rootOf(surface), here = kept;
  kept.ids_up_to = 0;
  kept = ask(oracle, {kept})[0];
  here = ask(oracle, {here})[0];
  for (int o = 0; o < 8; ++o) {
    std::vector<std::uint32_t> ids(kept.deviceList(o).count);
    ASSERT_TRUE(oracle.fetch(*kept.deviceLists(), kept.deviceList(o), ids.data()));
    std::vector<std::uint32_t> expected(here.listBegin(o), here.listEnd(o));
    std::sort(ids.begin(), ids.end());
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(ids, expected);
  }
}

TEST(Compute, ListsGoWhenNobodyHoldsThem) {
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(32)));
  std::uint32_t end = 0;
  for (int i = 0; i < 50; ++i) {
    ExpansionRequest root = rootOf(surface);
    root.ids_up_to = 0;
    root = ask(oracle, {root})[0];
    const std::uint32_t begin = root.deviceList(0).begin;
    if (i == 0) end = begin;
    EXPECT_EQ(begin, end) << "round " << i << ": the room of the last round was free again";
  }
}

TEST(Compute, SplitsWhatExceedsALimit) {
  const auto thread = newThread();
  ComputeOracle whole(thread);
  ComputeChain::Limits limits;
  limits.pairs = 400;
  limits.cells = 7;
  ComputeOracle split(thread, limits);
  const Surface surface = residentOn(whole, surfaceOf(test::torus(16)));
  const Surface same = residentOn(split, surface);
  std::vector<std::uint32_t> some(300);
  for (std::uint32_t i = 0; i < some.size(); ++i) some[i] = i;
  std::vector<ExpansionRequest> batch;
  for (int i = 0; i < 64; ++i) {
    batch.push_back(requestFor(surface, Cell{}.octant(i % 8).octant(i / 8), some.data(), some.size()));
  }
  const auto askAbout = [&](Oracle& oracle, const Surface& s) {
    for (ExpansionRequest& e : batch) e.surface = &s;
    return ask(oracle, batch);
  };
  const std::vector<ExpansionRequest> a = askAbout(whole, surface), b = askAbout(split, same);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    EXPECT_EQ(a[i].grey, b[i].grey);
    for (int o = 0; o < 8; ++o) EXPECT_EQ(a[i].listSize(o), b[i].listSize(o));
  }
  EXPECT_EQ(split.leftToCpu(), 0u);
  // What does not fit even alone is the CPU's.
  const ExpansionRequest root = ask(split, {rootOf(same)})[0], expected = ask(whole, {rootOf(surface)})[0];
  EXPECT_EQ(split.leftToCpu(), 1u);
  EXPECT_EQ(root.grey, expected.grey);
}

TEST(Compute, NoRoomForListsIsTheCpus) {
  ComputeChain::Limits limits;
  limits.bytes = 300000;
  ComputeOracle oracle(newThread(), limits);
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(40)));
  ExpansionRequest expected = rootOf(surface);
  expand(expected);
  std::vector<ExpansionRequest> batch(100, rootOf(surface));  // 320000 pairs
  const std::vector<ExpansionRequest> answers = ask(oracle, batch);
  EXPECT_EQ(oracle.leftToCpu(), 100u);
  for (const ExpansionRequest& e : answers) EXPECT_EQ(e.grey, expected.grey);
}

TEST(Compute, TablesStayWithinOneBuffer) {
  // Smaller buffers than any driver's: the states of 3000 cells take 1.7 MB.
  ComputeChain::Limits limits;
  limits.bytes = std::size_t{1} << 20;
  ComputeOracle oracle(newThread(), limits);
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(16)));
  std::vector<std::uint32_t> ids(surface.triangle_count);
  for (std::uint32_t i = 0; i < ids.size(); ++i) ids[i] = i;
  std::vector<ExpansionRequest> batch;
  for (int i = 0; i < 3000; ++i) {
    const std::uint32_t* const id = &ids[static_cast<std::size_t>(i) % ids.size()];
    batch.push_back(requestFor(surface, Cell{}.octant(i % 8).octant(i / 8 % 8), id, 1));
  }
  const std::vector<ExpansionRequest> answers = ask(oracle, batch);
  EXPECT_EQ(oracle.leftToCpu(), 0u);
  for (std::size_t i = 0; i < batch.size(); ++i) {
    ExpansionRequest expected = batch[i];
    expand(expected);
    ASSERT_EQ(answers[i].grey, expected.grey) << i;
  }
}

TEST(Compute, RunsAgainWhenTheRoomWasTooSmall) {
  // Triangles that meet every octant: lists of eight times the parent's length, where two are expected.
  test::Raw raw = test::soup(500, 1);
  for (auto& t : raw.triangles) {
    raw.vertices[t[0]].setZero();
    raw.vertices[t[1]].setOnes();
  }
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(raw));
  ExpansionRequest expected = rootOf(surface);
  expand(expected);
  for (const std::size_t up_to : {std::size_t{0}, std::size_t{32}, ExpansionRequest::kAll}) {
    ExpansionRequest root = rootOf(surface);
    root.ids_up_to = up_to;
    root = ask(oracle, {root})[0];
    EXPECT_EQ(root.grey, expected.grey);
    std::size_t all = 0;
    for (int o = 0; o < 8; ++o) {
      EXPECT_EQ(root.listSize(o), expected.listSize(o));
      all += root.listSize(o);
    }
    EXPECT_GT(all, 2 * root.count + 8);
  }
  EXPECT_EQ(oracle.leftToCpu(), 0u);
}

TEST(Compute, AHundredThousandCellsInABatch) {
  ComputeOracle oracle(newThread());
  const Surface a = residentOn(oracle, surfaceOf(test::torus(24))),
                b = residentOn(oracle, surfaceOf(test::soup(2000, 3)));
  std::mt19937_64 g(5);
  std::vector<std::uint32_t> ids(100000);
  std::vector<ExpansionRequest> batch;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const Surface& surface = i % 2 ? a : b;
    ids[i] = static_cast<std::uint32_t>(g() % surface.triangle_count);
    const int level = 2 + static_cast<int>(g() % 8);
    batch.push_back(requestFor(surface, cellAbout(surface.corner(ids[i], 0), level), &ids[i], 1));
  }
  const std::vector<ExpansionRequest> answers = ask(oracle, batch);
  std::size_t grey = 0;
  for (std::size_t i = 0; i < batch.size(); ++i) {
    for (int o = 0; o < 8; ++o) {
      const Cell octant = batch[i].cell.octant(o);
      const bool expected = batch[i].surface->lattice.exists(octant) && meets(*batch[i].surface, ids[i], octant);
      ASSERT_EQ(answers[i].grey >> o & 1, expected) << "cell " << i << " octant " << o;
      grey += expected;
    }
  }
  EXPECT_GT(grey, 100000u);
  EXPECT_EQ(oracle.leftToCpu(), 0u);
}

TEST(Compute, ThreadsThatWaitTogether) {
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(16)));
  std::vector<std::uint8_t> expected;
  for (int o = 0; o < 8; ++o) {
    ExpansionRequest e = rootOf(surface);
    e.cell = Cell{}.octant(o);
    expand(e);
    expected.push_back(e.grey);
  }
  std::atomic<int> wrong{0};
  test::ThreadGroup(8, [&](std::size_t t) {
    for (std::size_t i = 0; i < 20; ++i) {
      const std::size_t size = 1 + (t + i) % 5;
      std::vector<ExpansionRequest> batch(size, rootOf(surface));
      for (std::size_t k = 0; k < size; ++k) batch[k].cell = Cell{}.octant(static_cast<int>((t + i + k) % 8));
      batch = ask(oracle, batch);
      for (std::size_t k = 0; k < size; ++k) wrong += batch[k].grey != expected[(t + i + k) % 8];
    }
  });
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(oracle.leftToCpu(), 0u);
}

TEST(Device, MeshesAreShared) {
  ComputeOracle oracle(newThread());
  const Surface a = surfaceOf(test::torus(16));
  const auto first = oracle.makeResident(a), second = oracle.makeResident(a);
  EXPECT_EQ(first, second);
  // 12 bytes a triangle; 24 a vertex for the parts and 24 for the doubles.
  EXPECT_EQ(first->bytes(), 12 * a.mesh->triangleCount() + 48 * a.mesh->vertexCount());
  const Surface other{a.mesh, lattice::Lattice(a.bounds, Subdivision::kBono, 514)};
  EXPECT_NE(oracle.makeResident(other), first);
}

TEST(Device, ALostContextLeavesEverythingToTheCpu) {
  for (const bool occlusion : {false, true}) {
    const auto thread = newThread();
    std::unique_ptr<Oracle> oracle;
    if (occlusion) {
      oracle = std::make_unique<OcclusionOracle>(thread, OcclusionOracle::Form::kConservative, 16);
    } else {
      oracle = std::make_unique<ComputeOracle>(thread);
    }
    const Surface surface = residentOn(*oracle, surfaceOf(test::torus(16)));
    ExpansionRequest root = rootOf(surface);
    root.ids_up_to = 0;
    root = ask(*oracle, {root})[0];
    std::vector<ExpansionRequest> children;
    for (int o = 0; o < 8; ++o) {
      ExpansionRequest child;
      child.surface = &surface;
      child.cell = root.cell.octant(o);
      child.count = root.listSize(o);
      if (root.on_device != 0) {
        child.resource = root.deviceLists();
        child.resource_begin = root.deviceList(o).begin;
      } else {
        child.ids = root.listBegin(o);
      }
      children.push_back(child);
    }
    testing::internal::CaptureStderr();
    thread->lose("a test says so");
    thread->lose("again");
    EXPECT_TRUE(thread->isLost());
    const std::string notice = testing::internal::GetCapturedStderr();
    EXPECT_NE(notice.find("a test says so"), std::string::npos);
    EXPECT_EQ(notice.find("again"), std::string::npos) << "one notice is enough";
    const std::vector<ExpansionRequest> answers = ask(*oracle, children);
    for (const ExpansionRequest& e : answers) {
      for (int o = 0; o < 8; ++o) EXPECT_EQ(e.grey >> o & 1, referenceGrey(surface, e.cell.octant(o)));
    }
    EXPECT_EQ(oracle->makeResident(surfaceOf(test::torus(8))), nullptr);
    // Without a mesh on the host there is nobody to ask.
    Surface released = surface;
    released.mesh = nullptr;
    for (ExpansionRequest& e : children) e.surface = &released;
    EXPECT_THROW(ask(*oracle, children), OracleError);
  }
}

TEST(Device, AChildAfterForkAnswersOnTheCpu) {
  ComputeOracle oracle(newThread());
  const Surface surface = residentOn(oracle, surfaceOf(test::torus(16)));
  const std::uint8_t expected = ask(oracle, {rootOf(surface)})[0].grey;
  const pid_t child = fork();
  if (child == 0) {
    // _exit: the child runs none of the parent's destructors or tests.
    alarm(60);
    if (!oracle.thread().isForked()) _exit(2);
    if (ask(oracle, {rootOf(surface)})[0].grey != expected) _exit(3);
    try {
      makeOracle(OracleKind::kCompute, ContextRequest::kAnyDevice, 16);
      _exit(4);
    } catch (const OracleError&) {
    }
    _exit(oracle::makeOracle(OracleKind::kAuto, Answer::kConservative)->kind() == OracleKind::kCpu ? 0 : 5);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "status " << status;
  EXPECT_EQ(ask(oracle, {rootOf(surface)})[0].grey, expected) << "the parent goes on";
}

// The thread of the context waits for work in the parent for ever.
TEST(Device, AChildAfterForkMayDestroyAnOracle) {
  auto oracle = std::make_unique<ComputeOracle>(newThread());
  const Surface surface = surfaceOf(test::torus(8));
  ask(*oracle, {rootOf(surface)});
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    oracle = nullptr;
    _exit(0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "status " << status;
}

std::size_t residentBytes() {
  std::ifstream statm("/proc/self/statm");
  std::size_t size = 0, resident = 0;
  statm >> size >> resident;
  return resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
}

TEST(Device, RoundsLeakNothing) {
  const auto mesh = test::torus(256);
  const auto round = [&mesh] {
    const auto thread = newThread();
    ComputeOracle compute(thread);
    OcclusionOracle occlusion(thread, OcclusionOracle::Form::kConservative, 16);
    const Surface surface = residentOn(compute, surfaceOf(mesh));
    ExpansionRequest root = rootOf(surface);
    root.ids_up_to = 0;
    root = ask(compute, {root})[0];
    EXPECT_NE(root.grey, 0);
    return root.deviceLists();  // outlives its oracle
  };
  std::shared_ptr<const DeviceResource> last;
  for (int i = 0; i < 10; ++i) last = round();
  const std::size_t before = residentBytes();
  for (int i = 0; i < 40; ++i) last = round();
  // The mesh alone takes over 3 MiB a round, 120 MiB in all; drivers themselves keep up to 250 kB of each context.
  EXPECT_LT(residentBytes(), before + (std::size_t{48} << 20));
}

TEST(Device, MissingLibrariesAreNamed) {
  Libraries libraries;
  EXPECT_EQ(libraries.whyNot(), "");
  libraries.egl = {"libEGL-not-there.so.1"};
  EXPECT_NE(libraries.whyNot().find("libEGL-not-there.so.1"), std::string::npos);
  ContextRequest request;
  request.libraries = libraries;
  EXPECT_THROW(Thread thread(request), OracleError);
  libraries = Libraries();
  libraries.gl = {"libOpenGL-not-there.so.0", "libGL-not-there.so.1"};
  request.libraries = libraries;
  EXPECT_THROW(Thread thread(request), OracleError);
}

TEST(Device, WhatIsNotThereIsSaid) {
  ContextRequest request;
  request.device = 99;
  EXPECT_THROW(Thread thread(request), OracleError);
  request = ContextRequest();
  request.major = 9;
  try {
    Thread thread(request);
    ADD_FAILURE();
  } catch (const OracleError& e) {
    EXPECT_NE(std::string(e.what()).find("OpenGL 9.3"), std::string::npos) << e.what();
  }
}

TEST(Device, ResetsAreTold) {
  // Attributes of the wrong kind of OpenGL make a context that never tells of a reset.
  EXPECT_TRUE(newThread()->info().tells_resets);
}

TEST(Device, SoftwareIsKnownForWhatItIs) {
  // This machine's tests run on software, also where one driver is layered on another.
  const ContextInfo info = newThread(3)->info();
  const bool says_so = info.renderer.find("pipe") != std::string::npos;
  EXPECT_TRUE(!says_so || !info.hardware) << info.renderer;
}

// As on a GPU.
TEST(Compute, ALaneForEachOctant) {
  ComputeChain::Limits limits;
  limits.few_pairs = 4096;
  ComputeOracle compute(newThread(), limits);
  EXPECT_EQ(selfTest(compute), "");
  EXPECT_EQ(compute.leftToCpu(), 0u);
}

TEST(Device, PassesItsSelfTest) {
  ComputeOracle compute(newThread());
  EXPECT_EQ(selfTest(compute), "");
  EXPECT_EQ(selfTestOfWalks(compute), "");
  EXPECT_EQ(compute.leftToCpu(), 0u);
}

bool isOfName(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

std::string nameAt(const std::string& text, std::size_t at) {
  std::size_t end = at;
  while (end < text.size() && isOfName(text[end])) ++end;
  return text.substr(at, end - at);
}

// The variables of a shader that are vectors, not arrays of them.
std::set<std::string> vectorsOf(const std::string& source) {
  std::set<std::string> names;
  for (const char* type : {"vec2 ", "vec3 ", "vec4 "}) {
    for (std::size_t at = source.find(type); at != std::string::npos; at = source.find(type, at)) {
      at += 5;
      for (std::string name = nameAt(source, at); !name.empty(); name = nameAt(source, at)) {
        const std::size_t end = at + name.size();
        if (source[end] != '[' && source[end] != '(') names.insert(name);
        at = source.compare(end, 2, ", ") == 0 ? end + 2 : end;
        if (at == end) break;
      }
    }
  }
  return names;
}

// Is a component of that vector written by an index that is not a number?
bool isWrittenByIndex(const std::string& source, const std::string& vector) {
  for (std::size_t at = source.find(vector + "["); at != std::string::npos; at = source.find(vector + "[", at + 1)) {
    if (at > 0 && isOfName(source[at - 1])) continue;
    const std::size_t end = source.find(']', at);
    const std::string index = source.substr(at + vector.size() + 1, end - at - vector.size() - 1);
    const bool is_number = index.find_first_not_of("0123456789u") == std::string::npos;
    const std::string after = source.substr(end + 1, 4);
    const bool is_written = after.compare(0, 3, " = ") == 0 || (after[0] == ' ' && after.compare(2, 2, "= ") == 0 &&
                                                                std::string("+-*/|&^").find(after[1]) < 7);
    if (is_written && !is_number) return true;
  }
  return false;
}

// What NVIDIA's driver 580 gets wrong: it does not link a component of a vector that is written by a variable index,
// and it computes arrays of doubles in float if they are `precise`.
TEST(Shaders, AvoidWhatADriverGetsWrong) {
  EXPECT_TRUE(isWrittenByIndex("vec3 x; x[axis] = 1;", "x"));
  EXPECT_TRUE(isWrittenByIndex("x[k] += 1;", "x"));
  EXPECT_FALSE(isWrittenByIndex("y = x[k] == 1; x[0] = 1; xx[k] = 1;", "x"));
  std::vector<std::pair<std::string, std::string>> all = ComputeChain::sources();
  all.emplace_back("pairs", PairWalker::source());
  std::size_t vectors = 0;
  for (const auto& [name, source] : all) {
    for (const char* type : {"precise double", "precise dvec"}) EXPECT_EQ(source.find(type), std::string::npos) << name;
    for (const std::string& vector : vectorsOf(source)) {
      ++vectors;
      EXPECT_FALSE(isWrittenByIndex(source, vector)) << name << ": " << vector;
    }
  }
  EXPECT_GT(vectors, 20u) << "no declarations are found any more";
}

// Shaders as a compiler for Vulkan sees them: what one driver lets pass is an error for another.
TEST(Shaders, AreValidForTheReferenceCompiler) {
  ASSERT_EQ(std::system("command -v glslangValidator spirv-val >/dev/null"), 0)
      << "needs glslang-tools and spirv-tools";
  const std::string folder = testing::TempDir() + "bocst_shaders_" + std::to_string(getpid());
  std::filesystem::create_directory(folder);
  std::vector<std::pair<std::string, std::string>> files;
  for (const auto& [name, source] : ComputeChain::sources()) files.emplace_back(name + ".comp", source);
  files.emplace_back("pairs.comp", PairWalker::source());
  for (const auto form : {OcclusionOracle::Form::kConservative, OcclusionOracle::Form::kSampled}) {
    for (const Program::Stage& stage : OcclusionOracle::sources(form)) {
      const char* const ending = stage.type == GL_VERTEX_SHADER     ? ".vert"
                                 : stage.type == GL_GEOMETRY_SHADER ? ".geom"
                                                                    : ".frag";
      files.emplace_back("occlusion" + std::to_string(static_cast<int>(form)) + ending, stage.source);
    }
  }
  for (auto [name, source] : files) {
    const std::string file = folder + "/" + name;
    // glslang says that it has GL_ARB_gpu_shader5 in 3.30, but not its `precise`.
    const std::size_t version = source.find("#version 330");
    if (version != std::string::npos) source.replace(version, 12, "#version 400");
    std::ofstream(file) << source;
    EXPECT_EQ(std::system(("glslangValidator " + file + " >" + file + ".log 2>&1").c_str()), 0) << file;
    // Names in place of numbers that SPIR-V asks for; OpenGL gives them itself.
    if (name.find(".comp") == std::string::npos) continue;
    const std::string spirv = file + ".spv";
    EXPECT_EQ(std::system(("glslangValidator -G --aml -o " + spirv + " " + file + " >" + file +
                           ".log 2>&1 && spirv-val " + spirv + " >>" + file + ".log 2>&1")
                              .c_str()),
              0)
        << file;
  }
  if (!HasFailure()) std::filesystem::remove_all(folder);
}

TEST(Device, AShaderThatDoesNotCompileIsAnError) {
  const auto thread = newThread();
  for (const char* source : {"#version 430 core\nlayout(local_size_x = 1) in;\nvoid main() { nonsense; }\n",
                             "#version 430 core\nlayout(local_size_x = 1) in;\nvoid other() {}\n"}) {
    try {
      thread->run([&] { Program program({{GL_COMPUTE_SHADER, source}}); });
      ADD_FAILURE() << source;
    } catch (const OracleError& e) {
      EXPECT_NE(std::string(e.what()).find("the driver refuses"), std::string::npos) << e.what();
    }
  }
  thread->run([] { EXPECT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR)); });
}

struct Seen {
  std::size_t grey = 0, missed = 0, added = 0, unexplained = 0;
};

// What the device sees on its own, against the reference, for the children of the grey cells of some levels.
Seen lookAt(OcclusionOracle& oracle, const Surface& surface, int levels) {
  Seen seen;
  std::vector<std::vector<std::uint32_t>> lists;
  std::vector<ExpansionRequest> level{rootOf(surface)};
  for (int l = 1; l <= levels; ++l) {
    std::vector<ExpansionRequest*> requests;
    for (ExpansionRequest& e : level) requests.push_back(&e);
    const std::vector<std::uint8_t> candidates = oracle.candidates(requests);
    std::vector<ExpansionRequest> next;
    std::vector<std::vector<std::uint32_t>> next_lists;
    for (std::size_t i = 0; i < level.size(); ++i) {
      ExpansionRequest e = level[i];
      expand(e);
      for (int o = 0; o < 8; ++o) {
        const bool grey = e.grey >> o & 1, candidate = candidates[i] >> o & 1;
        const Cell octant = e.cell.octant(o);
        seen.grey += grey;
        seen.missed += grey && !candidate;
        if (candidate && !grey) {
          ++seen.added;
          // The pads let a triangle pass that is as near as 64 roundings of its own size.
          bool explained = false;
          for (std::size_t k = 0; k < e.count && !explained; ++k) {
            const std::uint32_t t = e.ids == nullptr ? static_cast<std::uint32_t>(k) : e.ids[k];
            double size = octant.side();
            for (int c = 0; c < 3; ++c) {
              size = std::max(size, (surface.corner(t, c) - centerOf(octant)).lpNorm<Eigen::Infinity>());
            }
            explained = meets(surface, t, octant, 64 * 0x1p-24 * size);
          }
          seen.unexplained += !explained;
        }
        if (!grey) continue;
        next_lists.emplace_back(e.listBegin(o), e.listEnd(o));
        next.push_back(requestFor(surface, octant, next_lists.back().data(), next_lists.back().size()));
      }
    }
    lists.swap(next_lists);
    level.swap(next);
  }
  return seen;
}

TEST(Occlusion, ConservativeQueriesLoseNothingAndAddOnlyTheirPad) {
  OcclusionOracle oracle(newThread(3), OcclusionOracle::Form::kConservative, 16);
  for (const test::Raw& raw : {test::torus(24), test::adversarial(), test::soup(300, 2)}) {
    const Surface surface = residentOn(oracle, surfaceOf(raw));
    const Seen seen = lookAt(oracle, surface, 5);
    EXPECT_GT(seen.grey, 500u);
    EXPECT_EQ(seen.missed, 0u);
    EXPECT_EQ(seen.unexplained, 0u) << "of " << seen.added;
  }
}

TEST(Occlusion, SampledQueriesLoseSurface) {
  // The paper's own form; more pixels lose less, and none is enough.
  const auto thread = newThread(3);
  std::vector<std::size_t> missed;
  for (const int viewport : {8, 64}) {
    OcclusionOracle oracle(thread, OcclusionOracle::Form::kSampled, viewport);
    const Surface thin = residentOn(oracle, surfaceOf(test::adversarial()));
    const Surface torus = residentOn(oracle, surfaceOf(test::torus(24)));
    const Seen on_thin = lookAt(oracle, thin, 5), on_torus = lookAt(oracle, torus, 5);
    EXPECT_GT(on_thin.missed, on_thin.grey / 20);
    missed.push_back(on_torus.missed);
    EXPECT_LT(on_torus.missed, on_torus.grey / 5);
  }
  EXPECT_GT(missed[0], missed[1]);
}

}  // namespace
}  // namespace bocst::oracle::gl
