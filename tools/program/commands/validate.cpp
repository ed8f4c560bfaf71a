// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "commands/validation.h"
#include "pairs/beyond_limits.h"
#include "pairs/poses.h"
#include "pairs/query_pair.h"
#include "picture/pair_page.h"
#include "picture/pair_picture.h"

namespace bocst::program {
namespace {

using Order = QueryPair::Order;

struct Validate {
  std::string file_a;
  std::string file_b;
  std::size_t poses = 1000;
  std::uint64_t seed = 1;
  bool compare_contacts = false;
  bool histogram = false;
  Shard shard;
  std::vector<std::string> references{"obbrss"};
  ModelArguments model;
  std::string html_file;
  ImageArguments image;
  Output output;

  static FclTree treeOf(const std::string& name) {
    return name == "obb" ? FclTree::kObb : name == "rss" ? FclTree::kRss : FclTree::kObbRss;
  }

  /// True if the contacts differ only by pairs that FCL's trees cull and its own triangle test finds touching.
  static bool culledByFcl(const QueryPair& ours, const FclPair& fcl, const Eigen::Isometry3d& X_AB, Order order) {
    const std::vector<QueryPair::Contact> mine = ours.contacts(X_AB, QueryPair::kAll, order);
    const std::vector<QueryPair::Contact> theirs = fcl.contacts(X_AB, QueryPair::kAll, order);
    if (!std::includes(mine.begin(), mine.end(), theirs.begin(), theirs.end())) return false;
    return std::all_of(mine.begin(), mine.end(), [&](const QueryPair::Contact& contact) {
      return std::binary_search(theirs.begin(), theirs.end(), contact) || fcl.trianglesTouch(contact, X_AB, order);
    });
  }

  /// @return true if the first reference says that they touch.
  bool check(std::size_t number, const Pose& pose, const QueryPair& ours,
             const std::vector<std::unique_ptr<FclPair>>& all, Validation& sum) const {
    const Eigen::Isometry3d X_AB = pose.transform();
    bool missed = false;
    bool invented = false;
    bool sets = false;
    bool lost = false;
    std::array<bool, 2> hit{};
    std::array<bool, 2> reference_hit{};
    // Like with like: below the resolution of the scalar type FCL's own answer may depend on the argument order.
    for (const Order order : {Order::kAB, Order::kBA}) {
      const std::size_t o = order == Order::kAB ? 0 : 1;
      hit[o] = ours.touch(X_AB, order);
      std::vector<QueryPair::Contact> contacts;
      if (compare_contacts) contacts = ours.contacts(X_AB, QueryPair::kAll, order);
      for (std::size_t i = 0; i < all.size(); ++i) {
        const bool expected = all[i]->touch(X_AB, order);
        if (i == 0) reference_hit[o] = expected;
        bool more = !expected && hit[o];
        bool differ = false;
        if (compare_contacts) differ = all[i]->contacts(X_AB, QueryPair::kAll, order) != contacts;
        // FCL's float trees cull without regard to rounding, so its triangle test has the last word there.
        if (model.exact() && model.scalarKind() == Scalar::kFloat && (more || differ) &&
            culledByFcl(ours, *all[i], X_AB, order)) {
          lost = true;
          more = differ = false;
        }
        missed |= expected && !hit[o];
        invented |= more;
        sets |= differ;
      }
    }
    const bool order_matters = hit[0] != hit[1];
    ++sum.count[Validation::kPoses];
    sum.count[Validation::kReferenceHits] += reference_hit[0];
    sum.count[Validation::kHits] += hit[0];
    sum.count[Validation::kFalseNegatives] += missed;
    sum.count[Validation::kFalsePositives] += invented;
    sum.count[Validation::kOrderDifferences] += order_matters;
    sum.count[Validation::kReferenceOrderDifferences] += reference_hit[0] != reference_hit[1];
    sum.count[Validation::kContactDifferences] += sets;
    sum.count[Validation::kLostByFcl] += lost;
    if (missed || (model.exact() ? invented || sets : order_matters)) {
      sum.fail(number, pose,
               missed           ? "false negative"
               : !model.exact() ? "argument order matters"
               : invented       ? "false positive"
                                : "contacts differ");
    }
    return reference_hit[0];
  }

  int run() const {
    output.check({file_a, file_b}, {html_file, image.file});
    std::optional<render::Renderer> renderer;
    if (image.wanted()) renderer.emplace(model.options().oracle);
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = loadMesh(file_b);
    const MeshArrays a(*mesh_a, model.scalarKind());
    const MeshArrays b(*mesh_b, model.scalarKind());
    std::vector<std::unique_ptr<FclPair>> all;
    for (const std::string& name : references) all.push_back(buildFclPair(treeOf(name), model.scalarKind(), a, b));
    const std::unique_ptr<BocstPair> ours = makeBocstPair(model.scalarKind(), a, b, model.options());
    std::vector<std::unique_ptr<BocstPair>> by_depth;  // [0] is depth 1
    if (histogram) {
      Options options = model.options();
      for (options.depth = 1; options.depth <= model.depth; ++options.depth) {
        by_depth.push_back(makeBocstPair(model.scalarKind(), a, b, options));
      }
    }

    Validation sum;
    sum.settings = {{"a", file_a},
                    {"b", file_b},
                    {"options", model.json()},
                    {"oracle", ours->oracleName()},
                    {"reference", references},
                    {"contacts_compared", compare_contacts},
                    {"poses_in_all", poses},
                    {"seed", seed}};
    const std::string beyond = beyondLimits({mesh_a.get(), mesh_b.get()}, model.scalarKind());
    if (!beyond.empty()) sum.settings[Validation::kBeyondLimits] = beyond;
    sum.shard = shard;
    sum.overestimates.resize(by_depth.size());
    PoseSampler sampler(*mesh_a, *mesh_b, *all.front(), seed);
    const auto look = [&](std::size_t number, const Pose& pose) {
      const bool touching = check(number, pose, *ours, all, sum);
      if (touching || by_depth.empty()) return;
      const Eigen::Isometry3d X_AB = pose.transform();
      const double distance = all.front()->distance(X_AB) / sampler.smallerRadius();
      for (std::size_t i = 0; i < by_depth.size(); ++i) {
        if (by_depth[i]->touch(X_AB)) sum.overestimates[i].add(distance, number, pose);
      }
    };
    const std::optional<Pose> first = forPoses(sampler, look);

    // First of all the result: pictures may fail.
    if (output.wantsJson()) {
      output.write(sum.json());
    } else {
      sum.print();
    }
    if ((!html_file.empty() || renderer) && first) {
      const GrownPair grown = worst(*mesh_a, *mesh_b, sum, *first);
      if (!html_file.empty()) writeFile(html_file, pairPage(grown).html());
      if (renderer) writePng(image.file, pairPicture(*renderer, grown, image));
    }
    sum.throwIfWrong();
    return 0;
  }

 private:
  /// Calls look(number, pose) for the poses of this shard. Returns the first of them.
  template <typename F>
  std::optional<Pose> forPoses(PoseSampler& sampler, const F& look) const {
    std::optional<Pose> first;
    const std::size_t rays = (poses + PoseSampler::kPosesOnRay - 1) / PoseSampler::kPosesOnRay;
    Progress progress("ray", rays / shard.of);
    for (std::size_t ray = 0; ray < rays; ++ray) {
      if (!shard.has(ray)) continue;
      std::size_t number = ray * PoseSampler::kPosesOnRay;
      for (const Pose& pose : sampler.aroundContact(ray)) {
        if (number == poses) break;
        if (!first) first = pose;
        try {
          look(number++, pose);
        } catch (const std::exception& e) {
          throw std::runtime_error(std::string(e.what()) + " (pose " + pose.text() + ")");
        }
      }
      progress.step();
    }
    return first;
  }

  /// The first mismatch; else where conservative answers overestimate most; else the first pose.
  GrownPair worst(const Mesh& mesh_a, const Mesh& mesh_b, const Validation& sum, const Pose& first) const {
    Pose pose = first;
    std::string why = "no mismatch; the first pose";
    if (!sum.failures.empty()) {
      pose = sum.failures.front().pose;
      why = "mismatch: " + sum.failures.front().what;
    } else if (!sum.overestimates.empty() && sum.overestimates.back().count() > 0) {
      pose = sum.overestimates.back().pose;
      why = "reported as touching although " + formatNumber(sum.overestimates.back().largest) +
            " of the smaller radius apart, the farthest of " + std::to_string(sum.count[Validation::kPoses]) + " poses";
    }
    GrownPair grown(file_a, mesh_a, file_b, mesh_b, model, pose, QueryPair::kAll);
    grown.facts = {{"this pose", why}};
    return grown;
  }
};

}  // namespace

void addValidate(CLI::App& program, Job& job) {
  auto validate = std::make_shared<Validate>();
  CLI::App* command = program.add_subcommand("validate", "compare answers with FCL's on many poses around contact");
  command->footer(
      "Of each eight poses, six are 1e-9 to 1e-1 of the smaller mesh's radius before or after the first contact;\n"
      "two are at random distances.\n"
      "Each pose is checked in both argument orders, by bocst and by FCL. A mismatch is a false negative; with\n"
      "exact answers also a false positive or a different set of contacts; with conservative answers also a verdict\n"
      "that depends on the argument order.\n"
      "With --scalar float, a pair is not counted if FCL's trees cull it although FCL's own triangle test finds\n"
      "contact.\n"
      "--html and --image show the first mismatch; without a mismatch, the pose that conservative answers\n"
      "overestimate most (with --histogram), else the first pose.\n"
      "Exit code 0 means that there was no mismatch. Answers about degenerate triangles, or with --scalar float about\n"
      "coordinates above 1e9, may differ from FCL's (share/doc/guarantees.md, Limits): these are counted and give "
      "exit\n"
      "code 1, too, but the message says that the meshes have such.");
  command->add_option("a", validate->file_a, std::string("A: ") + kMeshFile)->required();
  command->add_option("b", validate->file_b, "B: mesh file")->required();
  command->add_option("--poses", validate->poses, "number of poses")->check(wholeNumber())->capture_default_str();
  command->add_option("--seed", validate->seed, "the same seed gives the same poses")
      ->check(wholeNumber(0))
      ->capture_default_str();
  command->add_flag("--contacts", validate->compare_contacts, "compare also the sets of triangle pairs");
  command->add_option("--reference", validate->references, "trees of FCL to compare with: obbrss, obb, rss (slow)")
      ->delimiter(',')
      ->check(CLI::IsMember({"obbrss", "obb", "rss"}))
      ->capture_default_str();
  command->add_flag(
      "--histogram", validate->histogram,
      "for each depth up to --depth: histogram of the distances at which conservative answers report contact");
  command
      ->add_option_function<std::string>(
          "--shard",
          [validate](const std::string& text) { read("--shard", [&] { validate->shard = Shard::parse(text); }); },
          "check only part i of n of the poses; `bocst merge` merges the reports")
      ->type_name("i/n");
  validate->model.addAll(*command);
  addHtml(*command, validate->html_file);
  validate->image.add(*command);
  addJson(*command, validate->output);
  command->callback([validate, command, &job] {
    validate->model.refuseIdle(*command);
    if (validate->compare_contacts && !validate->model.exact()) {
      throw CLI::ValidationError("--contacts", "needs --answer exact: only exact answers have triangle pairs");
    }
    if (validate->histogram && validate->model.exact()) {
      throw CLI::ValidationError("--histogram", "needs --answer conservative: only conservative answers overestimate");
    }
    job = [validate] { return validate->run(); };
  });
}

}  // namespace bocst::program
