// SPDX-License-Identifier: BSD-3-Clause
// What the paper's tables say.
#pragma once

#include <bocst/options.h>

#include <cstddef>
#include <vector>

namespace bocst::program {

/// Tables 1 and 2: nodes by level, from level 1 on.
struct PaperTree {
  double dimension;  ///< d_t; 0: any (O-BOCST).
  std::vector<std::size_t> nodes;
};

struct PaperMesh {
  const char* name;
  std::size_t triangles;
  int table, figure;
  std::vector<PaperTree> trees;
};

// clang-format off
inline const std::vector<PaperMesh>& paperMeshes() {
  static const std::vector<PaperMesh> meshes = {
      {"bunny", 5110, 1, 3,
       {{0, {1, 8, 42, 193, 819, 3394}},
        {514, {1, 2, 9, 44, 192, 820, 3385}},
        {768, {1, 4, 16, 99, 436, 1850, 7659}},
        {896, {1, 7, 30, 142, 593, 2551, 10463}},
        {1023, {1, 8, 43, 192, 812, 3348, 13716}}}},
      {"dragon", 5104, 2, 4,
       {{0, {1, 8, 26, 102, 406, 1673}},
        {514, {1, 2, 9, 27, 101, 406, 1719}},
        {768, {1, 5, 14, 59, 221, 919, 3894}},
        {896, {1, 6, 19, 83, 310, 1297, 5363}},
        {1023, {1, 8, 26, 100, 401, 1696, 7049}}}}};
  return meshes;
}
// clang-format on

/// Table 3: what the animation was run with, by method.
struct PaperParameter {
  const char* name;
  const char* octree;
  const char* bono;
};

inline const std::vector<PaperParameter>& paperParameters() {
  static const std::vector<PaperParameter> parameters = {{"Coll. depth", "5", "5, 6"},
                                                         {"Max. time", "2.0", "2.0"},
                                                         {"Anim. frames", "2200", "2200"},
                                                         {"d_t", "514, 832, 1024", "514, 832, 1024"}};
  return parameters;
}

/// Tables 4 to 6: one method's column.
struct PaperRun {
  struct Second {
    double frames_per_second;
    std::size_t queries;
  };
  int table;
  double dimension;
  Subdivision subdivision;
  int depth;
  double seconds;  ///< In all; the last one is not in the rows.
  std::vector<Second> by_second;

  std::size_t queries() const {
    std::size_t sum = 0;
    for (const Second& s : by_second) sum += s.queries;
    return sum;
  }
};

// clang-format off
inline const std::vector<PaperRun>& paperRuns() {
  constexpr Subdivision o = Subdivision::kOctree, b = Subdivision::kBono;
  static const std::vector<PaperRun> runs = {
      {4, 514, o, 5, 6.869,
       {{192.81, 0}, {310.38, 524}, {337.66, 254}, {355.29, 144}, {371.63, 22}, {370.63, 0}}},
      {4, 514, b, 5, 6.479,
       {{260.74, 0}, {328.34, 368}, {364.64, 64}, {370.26, 0}, {371.63, 0}, {366.27, 28}}},
      {4, 514, b, 6, 6.609,
       {{258.74, 0}, {295.41, 702}, {354.65, 166}, {367.27, 0}, {369.63, 0}, {367.27, 28}}},
      {5, 832, o, 5, 7.120,
       {{243.76, 148}, {274.45, 902}, {329.67, 412}, {304.39, 588}, {340.66, 328}, {368.63, 8}, {335.33, 742}}},
      {5, 832, b, 5, 6.970,
       {{247.75, 86}, {298.40, 644}, {336.66, 208}, {312.38, 412}, {353.65, 130}, {348.30, 132}}},
      {5, 832, b, 6, 7.751,
       {{234.53, 50}, {227.77, 1270}, {262.74, 1064}, {303.39, 588}, {266.73, 908}, {370.26, 0}, {329.67, 326}}},
      {6, 1024, o, 5, 7.881,
       {{177.64, 178}, {279.72, 828}, {311.38, 388}, {290.71, 740}, {314.69, 532}, {347.31, 208}, {323.68, 754}}},
      {6, 1024, b, 5, 7.250,
       {{225.77, 234}, {296.70, 742}, {319.36, 514}, {303.70, 518}, {336.33, 344}, {333.67, 384}, {330.34, 406}}},
      {6, 1024, b, 6, 8.752,
       {{185.63, 70}, {209.79, 1410}, {228.77, 1402}, {303.39, 538}, {234.77, 1246}, {216.57, 1454}, {345.65, 226},
        {288.42, 848}}}};
  return runs;
}
// clang-format on

}  // namespace bocst::program
