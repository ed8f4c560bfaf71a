// SPDX-License-Identifier: BSD-3-Clause
#include "paper/paper_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <sstream>
#include <utility>

#include "cli/words.h"

namespace bocst::program {
namespace {

constexpr std::size_t kLineWidth = 120;

/// Markdown, wrapped.
class Text {
 public:
  void heading(int level, const std::string& words) {
    gap();
    text_ += std::string(static_cast<std::size_t>(level), '#') + " " + words + "\n";
  }

  void paragraph(const std::string& words) {
    gap();
    wrap(words, "");
  }

  /// One item; items follow each other without a gap.
  void item(const std::string& words) {
    if (!in_list_) gap();
    in_list_ = true;
    wrap("- " + words, "  ");
  }

  void block(const std::string& kind, const std::string& lines) {
    gap();
    text_ += "```" + kind + "\n" + lines + "```\n";
  }

  /// The first row is the head. Columns from `right_from` on are figures, to the right.
  void table(const std::vector<std::vector<std::string>>& rows, std::size_t right_from) {
    gap();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      for (const std::string& cell : rows[i]) text_ += "| " + cell + (cell.empty() ? "" : " ");
      text_ += "|\n";
      if (i > 0) continue;
      for (std::size_t k = 0; k < rows[0].size(); ++k) text_ += k < right_from ? "|---" : "|--:";
      text_ += "|\n";
    }
  }

  void picture(const std::string& name, const std::string& what) { paragraph("![" + what + "](" + name + ")"); }

  std::string take() { return std::move(text_); }

 private:
  void gap() {
    in_list_ = false;
    if (!text_.empty()) text_ += "\n";
  }

  void wrap(const std::string& words, const std::string& indent) {
    std::istringstream stream(words);
    std::string line;
    for (std::string word; stream >> word;) {
      const bool is_unit = word[0] == '%';  // stays with its figure
      if (!line.empty() && !is_unit && line.size() + 1 + word.size() > kLineWidth) {
        text_ += line + "\n";
        line = indent + word;
      } else {
        line += (line.empty() ? "" : " ") + word;
      }
    }
    text_ += line + "\n";
  }

  std::string text_;
  bool in_list_ = false;
};

/// "+1.2 %", of small counts "+2 nodes".
std::string difference(std::size_t ours, std::size_t paper) {
  if (ours == paper) return "0";
  const double delta = static_cast<double>(ours) - static_cast<double>(paper);
  const std::string sign = delta > 0 ? "+" : "-";
  if (paper < 32) return sign + formatPlain(std::abs(delta)) + (std::abs(delta) == 1 ? " node" : " nodes");
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f %%", 100 * std::abs(delta) / static_cast<double>(paper));
  return sign + text;
}

std::string percent(double part) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.1f %%", 100 * part);
  return text;
}

std::string fileName(const StudyMesh& mesh) { return std::filesystem::path(mesh.file).filename().string(); }

std::string seconds(double microseconds) { return formatNumber(1e-6 * microseconds) + " s"; }

double framesPerSecond(const Animation::Part& part) {
  return 1e6 * static_cast<double>(part.frames) / std::max(part.microseconds, 1e-3);
}

/// "13 400": three figures are all that a time is good for.
std::string rate(double per_second) {
  const double power = std::pow(10, std::max(0.0, std::floor(std::log10(std::max(per_second, 1.0))) - 2));
  std::string text = formatPlain(std::round(per_second / power) * power);
  for (auto i = static_cast<std::ptrdiff_t>(text.size()) - 3; i > 0; i -= 3) {
    text.insert(static_cast<std::size_t>(i), " ");
  }
  return text;
}

std::string columnName(const PaperRun& run) { return methodName(run.subdivision) + " l=" + std::to_string(run.depth); }

std::string dimensionOf(const TreeStudy::Tree& tree) {
  return tree.dimension == 0 ? "any" : formatPlain(tree.dimension);
}

std::size_t deepest(const TreeStudy& study) {
  std::size_t depth = 0;
  for (const TreeStudy::Tree& tree : study.trees) depth = std::max(depth, tree.levels.size());
  return depth;
}

std::vector<std::string> levelHead(std::vector<std::string> head, std::size_t depth) {
  for (std::size_t l = 1; l <= depth; ++l) head.push_back(std::to_string(l));
  return head;
}

// Tables 1 and 2.

/// How far the levels of trees are from the paper's, leaving out small ones, where one node is many per cent.
struct Deviation {
  std::size_t levels = 0;
  double mean = 0, most = 0;
};

Deviation deviationOf(const TreeStudy& study, bool octree) {
  Deviation d;
  for (const TreeStudy::Tree& tree : study.trees) {
    if (tree.paper == nullptr || (tree.dimension == 0) != octree) continue;
    for (std::size_t i = 0; i < std::min(tree.paper->nodes.size(), tree.levels.size()); ++i) {
      const auto paper = static_cast<double>(tree.paper->nodes[i]);
      if (paper < 32) continue;
      const double part = std::abs(static_cast<double>(tree.levels[i].nodes) - paper) / paper;
      ++d.levels;
      d.mean += part;
      d.most = std::max(d.most, part);
    }
  }
  d.mean /= static_cast<double>(std::max<std::size_t>(d.levels, 1));
  return d;
}

void writeNodes(Text& text, const TreeStudy& study) {
  const PaperMesh& paper = *study.paper;
  text.heading(2, "Table " + std::to_string(paper.table) + ": nodes by level of the " + paper.name);
  const std::size_t depth = deepest(study);
  std::vector<std::vector<std::string>> rows{levelHead({"d_t", "method", ""}, depth)};
  bool sampled = false;
  double least_lost = 1, most_lost = 0;
  for (const TreeStudy::Tree& tree : study.trees) {
    if (tree.paper == nullptr) continue;
    std::vector<std::string> theirs{dimensionOf(tree), methodOf(tree), "paper"}, ours{"", "", "bocst"},
        delta{"", "", "difference"}, missing{"", "", "sampled"};
    for (std::size_t i = 0; i < tree.levels.size(); ++i) {
      const bool has = i < tree.paper->nodes.size();
      theirs.push_back(has ? std::to_string(tree.paper->nodes[i]) : "");
      ours.push_back(std::to_string(tree.levels[i].nodes));
      delta.push_back(has && i > 0 ? difference(tree.levels[i].nodes, tree.paper->nodes[i]) : "");
    }
    rows.push_back(theirs);
    rows.push_back(ours);
    rows.push_back(delta);
    if (tree.sampled.empty()) continue;
    sampled = true;
    for (const std::size_t nodes : tree.sampled) missing.push_back(std::to_string(nodes));
    missing.resize(3 + depth);
    rows.push_back(missing);
    const double lost = 1 - static_cast<double>(tree.sampled.size() == tree.levels.size() ? tree.sampled.back() : 0) /
                                static_cast<double>(tree.levels.back().nodes);
    least_lost = std::min(least_lost, lost);
    most_lost = std::max(most_lost, lost);
  }
  text.table(rows, 3);
  const Deviation o = deviationOf(study, true), b = deviationOf(study, false);
  text.paragraph(
      "On the levels where the paper has 32 nodes or more, the numbers of nodes of O differ from the paper's by " +
      percent(o.mean) + " on average and " + percent(o.most) + " at most, those of B by " + percent(b.mean) + " and " +
      percent(b.most) + ". The differences have these causes:");
  text.item("**The mesh.** The paper's file is not available. Our mesh is " + fileName(study.mesh) + ", " +
            std::to_string(study.mesh.mesh->triangleCount()) + " triangles" +
            (study.mesh.mesh->triangleCount() < study.mesh.triangles_of_file
                 ? " decimated from " + std::to_string(study.mesh.triangles_of_file)
                 : std::string()) +
            "; the paper's mesh has " + std::to_string(paper.triangles) + ".");
  text.item("**Exact cells.** A cell is grey if a closed triangle meets the closed cell. The paper samples the " +
            std::string("centres of pixels, which misses thin overlaps; our test misses none.") +
            (sampled ? " *sampled* is the paper's own test on our mesh: at the deepest level it finds between " +
                           percent(least_lost) + " and " + percent(most_lost) + " fewer nodes than there are."
                     : std::string()));
  text.item(
      "**Where B is split.** The mesh lies at the lower corner of the lattice, and the first split is at 512. With d_t "
      "between 514 and 1023 the upper cells are narrow, and the surface often extends only a little into them. The "
      "first levels have few nodes, so one missed overlap, or a different outline, changes their numbers by a large "
      "part; the octants below that node change, too.");
}

// Figures 3 and 4.

Plot errorPlot(const TreeStudy& study) {
  Plot plot;
  plot.title = "Average error of the " + std::string(study.paper->name);
  plot.x_name = "d_t";
  plot.y_name = "average error";
  plot.y_logarithmic = true;
  std::size_t depth = deepest(study);
  const TreeStudy::Tree& octree = study.at(0);
  double low = 0, high = 0;
  for (const TreeStudy::Tree& tree : study.trees) {
    if (tree.dimension == 0) continue;
    plot.x_ticks.push_back(tree.dimension);
    low = low == 0 ? tree.dimension : std::min(low, tree.dimension);
    high = std::max(high, tree.dimension);
  }
  for (std::size_t l = 2; l <= depth; ++l) {
    PlotLine b, o;
    b.colour = o.colour = l - 2;
    b.name = l == 2 ? "B-BOCST" : "";
    o.name = l == 2 ? "O-BOCST" : "";
    b.label = "l = " + std::to_string(l);
    o.style = PlotLine::Style::kDashed;
    for (const TreeStudy::Tree& tree : study.trees) {
      if (tree.dimension != 0 && l <= tree.levels.size())
        b.points.push_back({tree.dimension, tree.levels[l - 1].average});
    }
    if (l <= octree.levels.size()) {
      const double error = octree.levels[l - 1].average;
      o.points = {{low, error}, {high, error}};
    }
    plot.lines.push_back(o);
    plot.lines.push_back(b);
  }
  return plot;
}

void writeErrors(Text& text, const TreeStudy& study, std::vector<PaperReport::Named>& pictures) {
  const PaperMesh& paper = *study.paper;
  text.heading(2, "Figure " + std::to_string(paper.figure) + ": average error of the " + paper.name);
  pictures.push_back({"pictures/paper-figure" + std::to_string(paper.figure) + ".png", {errorPlot(study)}, 620});
  text.picture(pictures.back().name, "The average error by d_t, a line for each level, O dashed and B solid");
  if (paper.figure == 3) {
    text.paragraph(
        "The error of a node (5.2) is the greatest distance from a point of its sphere to the surface inside that "
        "sphere, divided by the diameter of the root's sphere. It states how far from the surface a conservative "
        "answer can be. With this reading of 5.2, \"the maximum error is equal to 1.0 when the root sphere is tangent "
        "to the object surface\" holds. The error of each level is that of a tree that ends at this level. The "
        "distance is exact; the point of the sphere is found by a search, to about a hundredth. The output of `--json` "
        "has minimum and maximum.");
  }
  std::vector<std::vector<std::string>> rows{levelHead({"d_t", "method"}, deepest(study))};
  for (const TreeStudy::Tree& tree : study.trees) {
    if (tree.paper == nullptr) continue;
    std::vector<std::string> row{dimensionOf(tree), methodOf(tree)};
    for (const LevelError& level : tree.levels) row.push_back(formatNumber(level.average));
    rows.push_back(row);
  }
  text.table(rows, 2);
  const auto average = [&](double dimension, std::size_t level) {
    const std::vector<LevelError>& levels = study.at(dimension).levels;
    return level <= levels.size() ? levels[level - 1].average : 0;
  };
  const double o5 = average(0, 5);
  if (!(o5 > 0)) return;
  text.paragraph("At level 5 the average error of O is " + formatNumber(o5) + "; that of B is " +
                 formatNumber(average(514, 5) / o5) + " times as large at d_t 514 and " +
                 formatNumber(average(1023, 5) / o5) +
                 " times as large at 1023. The paper's rule (5.3) gives B one more " +
                 "level below d_t 768: at 514, the error of B at level 6 is " + formatNumber(average(514, 6) / o5) +
                 " times the error of O at level 5.");
}

// Tables 4 to 6.

using Column = AnimationStudy::Column;
using OfOracle = AnimationStudy::OfOracle;

/// The oracle that the tables show: the paper's kind of query if there is one.
const OfOracle* shownOracle(const AnimationStudy& study) {
  const OfOracle* shown = nullptr;
  for (const OfOracle& of : study.oracles) {
    if (of.columns.empty()) continue;
    if (of.oracle.kind == OracleKind::kOcclusion) return &of;
    if (shown == nullptr || shown->oracle.kind == OracleKind::kSampled) shown = &of;
  }
  return shown;
}

std::vector<const Column*> columnsOf(const OfOracle& of, int table) {
  std::vector<const Column*> columns;
  for (const Column& column : of.columns) {
    if (column.paper->table == table) columns.push_back(&column);
  }
  return columns;
}

std::vector<Plot> secondPlots(const std::vector<const Column*>& columns) {
  Plot queries, frames;
  queries.title = "Queries in each second, d_t = " + formatPlain(columns.front()->paper->dimension);
  queries.y_name = "queries";
  frames.title = "Frames a second";
  frames.y_name = "frames a second";
  frames.y_logarithmic = true;
  std::size_t most = Animation::kSeconds;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const Column& column = *columns[c];
    PlotLine ours, theirs;
    ours.colour = theirs.colour = c;
    ours.name = columnName(*column.paper);
    theirs.name = "paper";
    theirs.style = PlotLine::Style::kDashed;
    PlotLine our_frames = ours, their_frames = theirs;
    most = std::max(most, column.paper->by_second.size());
    for (std::size_t s = 0; s < column.run.seconds.size(); ++s) {
      const Animation::Part& part = column.run.seconds[s];
      if (part.frames == 0) continue;
      ours.points.push_back({static_cast<double>(s + 1), static_cast<double>(part.octants)});
      our_frames.points.push_back({static_cast<double>(s + 1), framesPerSecond(part)});
    }
    for (std::size_t s = 0; s < column.paper->by_second.size(); ++s) {
      const PaperRun::Second& second = column.paper->by_second[s];
      theirs.points.push_back({static_cast<double>(s + 1), static_cast<double>(second.queries)});
      their_frames.points.push_back({static_cast<double>(s + 1), second.frames_per_second});
    }
    queries.lines.push_back(ours);
    queries.lines.push_back(theirs);
    frames.lines.push_back(our_frames);
    frames.lines.push_back(their_frames);
  }
  for (std::size_t s = 1; s <= most; ++s) queries.x_ticks.push_back(static_cast<double>(s));
  frames.x_ticks = queries.x_ticks;
  queries.x_name = frames.x_name = "second";
  return {queries, frames};
}

/// A column of the paper's and one of ours for each run, a row for each second, and what they come to.
void writeSeconds(Text& text, const std::vector<const Column*>& columns, const std::string& what,
                  std::string (*theirs)(const PaperRun::Second&), std::string (*ours)(const Animation::Part&),
                  std::pair<std::string, std::string> (*sums)(const Column&)) {
  std::vector<std::vector<std::string>> rows{{"second: " + what}};
  std::vector<std::string> all{"in all"};
  std::size_t most = Animation::kSeconds;
  for (const Column* column : columns) {
    rows[0].push_back(columnName(*column->paper) + ", paper");
    rows[0].push_back("bocst");
    const auto [their_sum, our_sum] = sums(*column);
    all.push_back(their_sum);
    all.push_back(our_sum);
    most = std::max(most, column->paper->by_second.size());
  }
  for (std::size_t s = 0; s < most; ++s) {
    std::vector<std::string> row{std::to_string(s + 1) + (Animation::rests(s + 1) ? " (bocst: at rest)" : "")};
    for (const Column* column : columns) {
      const auto& by_second = column->paper->by_second;
      row.push_back(s < by_second.size() ? theirs(by_second[s]) : "");
      const bool has = s < column->run.seconds.size() && column->run.seconds[s].frames > 0;
      row.push_back(has ? ours(column->run.seconds[s]) : "");
    }
    rows.push_back(row);
  }
  rows.push_back(all);
  text.table(rows, 1);
}

void writeRun(Text& text, const AnimationStudy& study, const OfOracle& shown, int table,
              std::vector<PaperReport::Named>& pictures) {
  const std::vector<const Column*> columns = columnsOf(shown, table);
  const double dimension = columns.front()->paper->dimension;
  text.heading(2, "Table " + std::to_string(table) + ": d_t = " + formatPlain(dimension));
  pictures.push_back({"pictures/paper-table" + std::to_string(table) + ".png", secondPlots(columns), 290});
  text.picture(pictures.back().name, "Queries and frames a second in each second of the animation");

  writeSeconds(
      text, columns, "queries", [](const PaperRun::Second& s) { return std::to_string(s.queries); },
      [](const Animation::Part& part) { return std::to_string(part.octants); },
      [](const Column& c) { return std::pair(std::to_string(c.paper->queries()), std::to_string(c.run.all.octants)); });
  writeSeconds(
      text, columns, "frames/s", [](const PaperRun::Second& s) { return formatPlain(std::round(s.frames_per_second)); },
      [](const Animation::Part& part) { return rate(framesPerSecond(part)); },
      [](const Column& c) { return std::pair(formatPlain(c.paper->seconds) + " s", seconds(c.run.all.microseconds)); });

  text.paragraph("The surfaces touch in " + std::to_string(study.touchingFrames(dimension)) + " of " +
                 std::to_string(study.frames) + " frames. Results of each oracle:");
  std::vector<std::vector<std::string>> rows{{"oracle", "run", "seconds", "frames/s", "queries", "by OpenGL",
                                              "frames that collide", "missed", "nodes at most", "at the end",
                                              "dropped"}};
  for (const OfOracle& of : study.oracles) {
    for (const Column* column : columnsOf(of, table)) {
      const Animation::Run& run = column->run;
      rows.push_back({of.oracle.name, columnName(*column->paper), seconds(run.all.microseconds),
                      rate(framesPerSecond(run.all)), std::to_string(run.all.octants),
                      run.all.gl_queries > 0 ? std::to_string(run.all.gl_queries) : "", std::to_string(run.all.hits),
                      std::to_string(column->missed), std::to_string(run.peak_nodes), std::to_string(run.last_nodes),
                      std::to_string(run.pruned_nodes)});
    }
  }
  text.table(rows, 2);
}

void writeAnimation(Text& text, const AnimationStudy& study) {
  text.heading(2, "The animation (5.4)");
  const std::string obstacles = joined(study.obstacles, ", ", [](const StudyMesh& mesh) { return fileName(mesh); });
  text.paragraph(
      "The paper moves an object of 5000 triangles over three objects on a path that it does not describe. Our "
      "animation moves " +
      fileName(study.object) + " over " + obstacles + ", in " + std::to_string(study.frames) +
      " frames with a Max. time of " + formatPlain(static_cast<double>(Animation::kMaxTime.count()) / 1000) +
      " s. The moving object comes down on the first object in second 2, moves to the second in second 4 and to the "
      "third in second 6, rotating as it moves, and stands still in seconds 3, 5 and 7. The path is made with objects "
      "of d_t 514: with these, the moving object enters the first object and just misses the others. The same path is "
      "used with the larger objects, which therefore overlap more, as in the paper.");
  text.item(
      "**Time.** The paper draws each frame, and drawing limits its frame rate. We draw nothing: *seconds* is the time "
      "of the queries alone, three calls of `fcl::collide` with conservative answers a frame. The age of branches is "
      "measured by a clock of the animation, by which the animation takes " +
      std::to_string(Animation::kSeconds) +
      " s on every machine (the paper's took 6.5 to 8.8 s). *Second* and Max. time refer to that clock.");
  text.item(
      "**Queries.** One query is one octant with an actual region whose parent is expanded "
      "(`Statistics::expanded_octants`); the paper runs its Algorithm 1 once for each such octant. Algorithm 1 views "
      "the octant from up to three sides, so it makes one to three occlusion queries, and the paper's tables do not "
      "say which of the two numbers they give. *By OpenGL* is the number of occlusion queries that were made. The "
      "oracle *occlusion* needs one for each octant; *sampled* is Algorithm 1 itself and may need three. *cpu* gets "
      "the first levels of a mesh of 4096 triangles or more from one pass over the mesh, so its number includes "
      "octants that no query needed.");
  text.item(
      "**Order.** The paper asks for one node after another. bocst asks for several at once (2, 4, 8, ... in a walk "
      "that ends at its first hit), so it waits less often and makes some more queries.");
  text.item(
      "**Missed** is the number of frames in which the surfaces touch by FCL's exact test but no pair of models "
      "collides. *Sampled* may miss collisions; no other oracle may.");
  std::vector<std::vector<std::string>> rows{{"oracle", "runs on"}};
  for (const OfOracle& of : study.oracles) {
    rows.push_back(
        {of.oracle.name, of.oracle.why_not.empty() ? of.oracle.device : "not to be had: " + of.oracle.why_not});
  }
  text.table(rows, 2);
}

std::string listOf(const std::set<double>& values) {
  return joined(values, ", ", [](double value) { return formatPlain(value); });
}

/// The paper's parameters, and those that all runs of the study were made with.
void writeParameters(Text& text, const AnimationStudy& study) {
  text.heading(2, "Table 3: parameters of the animation");
  std::vector<std::vector<std::string>> rows{{"", "O, paper", "bocst", "B, paper", "bocst"}};
  for (const PaperParameter& p : paperParameters()) rows.push_back({p.name, p.octree, "", p.bono, ""});
  for (const Subdivision subdivision : {Subdivision::kOctree, Subdivision::kBono}) {
    std::set<double> depths, dimensions;
    for (const PaperRun& run : paperRuns()) {
      if (run.subdivision != subdivision) continue;
      depths.insert(run.depth);
      dimensions.insert(run.dimension);
    }
    const std::size_t column = subdivision == Subdivision::kOctree ? 2 : 4;
    rows[1][column] = listOf(depths);
    rows[2][column] = formatPlain(static_cast<double>(Animation::kMaxTime.count()) / 1000);
    rows[3][column] = std::to_string(study.frames);
    rows[4][column] = listOf(dimensions);
  }
  text.table(rows, 1);
}

// What the paper claims.

std::string holds(bool it_does) { return it_does ? "yes" : "**no**"; }

const Column* columnFor(const OfOracle& of, double dimension, Subdivision subdivision, int depth) {
  for (const Column& column : of.columns) {
    const PaperRun& p = *column.paper;
    if (p.dimension == dimension && p.subdivision == subdivision && p.depth == depth) return &column;
  }
  return nullptr;
}

std::string pairText(std::uint64_t b, std::uint64_t o) { return std::to_string(b) + " : " + std::to_string(o); }

void writeClaims(Text& text, const AnimationStudy& study, const OfOracle& shown) {
  text.heading(2, "Which of the paper's claims hold");
  text.paragraph("The figures are those of the oracle " + shown.oracle.name + ", unless a row names another.");
  std::vector<std::vector<std::string>> rows{{"the paper's claim", "d_t", "paper", "bocst", "holds"}};
  const auto o5 = [&](double d) { return columnFor(shown, d, Subdivision::kOctree, 5); };
  const auto b5 = [&](double d) { return columnFor(shown, d, Subdivision::kBono, 5); };
  const auto b6 = [&](double d) { return columnFor(shown, d, Subdivision::kBono, 6); };
  for (const double d : Animation::kDimensions) {
    const std::uint64_t o = o5(d)->run.all.octants, b = b5(d)->run.all.octants;
    const bool power = std::exp2(std::round(std::log2(d))) == d;
    rows.push_back({power ? "B at a power of two asks as O does, within a fifth (4.4)"
                          : "B asks fewer queries than O at the same level",
                    formatPlain(d), pairText(b5(d)->paper->queries(), o5(d)->paper->queries()), pairText(b, o),
                    holds(power ? 5 * b >= 4 * o && 5 * b <= 6 * o : b < o)});
  }
  for (const double d : Animation::kDimensions) {
    const double o = o5(d)->run.all.microseconds, b = b5(d)->run.all.microseconds;
    rows.push_back({"B is faster than O at the same level", formatPlain(d),
                    formatPlain(b5(d)->paper->seconds) + " : " + formatPlain(o5(d)->paper->seconds) + " s",
                    seconds(b) + " : " + seconds(o), holds(b < o)});
  }
  for (const double d : Animation::kDimensions) {
    const Column* b = d < 768 ? b6(d) : b5(d);
    const auto apart = static_cast<double>(b->run.all.hits) - static_cast<double>(o5(d)->run.all.hits);
    rows.push_back({"B at the level of the rule (5.3), l=" + std::to_string(b->paper->depth) +
                        ", is as tight as O l=5: frames that collide differ by 5 % of all at most",
                    formatPlain(d), "", pairText(b->run.all.hits, o5(d)->run.all.hits),
                    holds(std::abs(apart) <= 0.05 * static_cast<double>(study.frames))});
  }
  std::uint64_t at_rest = 0;
  for (const Column& column : shown.columns) at_rest += column.run.all.still_octants;
  rows.push_back({"no queries while the contact does not move", "all", "", std::to_string(at_rest) + " at rest",
                  holds(at_rest == 0)});
  for (const OfOracle& of : study.oracles) {
    if (of.columns.empty()) continue;
    std::size_t missed = 0;
    for (const Column& column : of.columns) missed += column.missed;
    rows.push_back({"no collision is missed, oracle " + of.oracle.name, "all", "",
                    std::to_string(missed) + " of " + std::to_string(of.columns.size() * study.frames) + " frames",
                    holds(missed == 0)});
  }
  text.table(rows, 5);
  double all = 0, quiet = 0;
  for (const Column& column : shown.columns) {
    all += column.run.all.microseconds;
    quiet += column.run.all.quiet_microseconds;
  }
  text.paragraph(
      "Pairs of figures are B : O. The paper's time depends on its queries and its drawing. Of our time, " +
      percent(quiet / std::max(all, 1e-3)) +
      " is spent in frames without queries, in walks over spheres that are already resident. The time of a walk "
      "depends on the number of pairs of spheres that it tests. At the same level, the spheres of B are larger than "
      "those of O, and more so if the object fills less of its cube (d_t 514). If a region of B is clipped, the "
      "spheres of its octants may extend beyond its own sphere, so bocst culls by a larger sphere there.");
}

}  // namespace

PaperReport paperReport(const PaperStudy& study, const std::string& command) {
  PaperReport report;
  Text text;
  text.heading(1, "The paper's tables and figures, and ours");
  text.paragraph(
      "This report compares bocst with the paper *BOCST: Branch On-collide Sphere-trees* by Rodríguez and Franquesa. "
      "Section numbers are the paper's. The report is written by");
  text.block("sh", command + "\n");
  text.paragraph(
      "l is the level, with the root as level 1. O is the octree, B the branch-on-need octree. d_t is the largest "
      "extent of the mesh in lattice units.");
  for (const TreeStudy& trees : study.trees) {
    writeNodes(text, trees);
    writeErrors(text, trees, report.pictures);
  }
  writeAnimation(text, study.animation);
  writeParameters(text, study.animation);
  if (const OfOracle* shown = shownOracle(study.animation)) {
    for (const int table : {4, 5, 6}) writeRun(text, study.animation, *shown, table, report.pictures);
    writeClaims(text, study.animation, *shown);
  }
  report.text = text.take();
  return report;
}

}  // namespace bocst::program
