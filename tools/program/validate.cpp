// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "arguments.h"
#include "poses.h"
#include "query_pair.h"

namespace bocst::program {
namespace {

using Order = QueryPair::Order;

struct Validate {
  std::string file_a;
  std::string file_b;
  std::size_t poses = 1000;
  std::uint64_t seed = 1;
  bool compare_contacts = false;
  std::vector<std::string> references{"obbrss"};
  ModelArguments model;
  Output output;

  /// A pose with a wrong answer and what was wrong, for the report.
  struct Failure {
    Pose pose;
    std::string what;
  };

  struct Count {
    std::size_t reference_hits = 0;
    std::size_t hits = 0;
    std::size_t false_negatives = 0;
    std::size_t false_positives = 0;
    std::size_t order_differences = 0;
    std::size_t reference_order_differences = 0;
    std::size_t contact_differences = 0;
    std::size_t lost_by_fcl = 0;
    std::size_t mismatches = 0;
    std::vector<Failure> failures;
  };

  static FclTree treeOf(const std::string& name) {
    return name == "obb" ? FclTree::kObb : name == "rss" ? FclTree::kRss : FclTree::kObbRss;
  }

  /// Is all that sets us apart that FCL's trees culled pairs which its own triangle test finds touching?
  static bool culledByFcl(const QueryPair& ours, const FclPair& fcl, const Eigen::Isometry3d& X_AB, Order order) {
    const std::vector<QueryPair::Contact> mine = ours.contacts(X_AB, QueryPair::kAll, order);
    const std::vector<QueryPair::Contact> theirs = fcl.contacts(X_AB, QueryPair::kAll, order);
    if (!std::includes(mine.begin(), mine.end(), theirs.begin(), theirs.end())) return false;
    return std::all_of(mine.begin(), mine.end(), [&](const QueryPair::Contact& contact) {
      return std::binary_search(theirs.begin(), theirs.end(), contact) || fcl.trianglesTouch(contact, X_AB, order);
    });
  }

  void check(const Pose& pose, const QueryPair& ours, const std::vector<std::unique_ptr<FclPair>>& all,
             Count& count) const {
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
    count.reference_hits += reference_hit[0];
    count.hits += hit[0];
    count.false_negatives += missed;
    count.false_positives += invented;
    count.order_differences += order_matters;
    count.reference_order_differences += reference_hit[0] != reference_hit[1];
    count.contact_differences += sets;
    count.lost_by_fcl += lost;
    const bool wrong = missed || (model.exact() ? invented || sets : order_matters);
    if (!wrong) return;
    ++count.mismatches;
    constexpr std::size_t kEnough = 16;
    if (count.failures.size() < kEnough) {
      count.failures.push_back({pose, missed           ? "false negative"
                                      : !model.exact() ? "argument order matters"
                                      : invented       ? "false positive"
                                                       : "contacts differ"});
    }
  }

  int run() const {
    output.check();
    const std::shared_ptr<const Mesh> mesh_a = loadMesh(file_a);
    const std::shared_ptr<const Mesh> mesh_b = loadMesh(file_b);
    const MeshArrays a(*mesh_a, model.scalarKind());
    const MeshArrays b(*mesh_b, model.scalarKind());
    std::vector<std::unique_ptr<FclPair>> all;
    for (const std::string& name : references) all.push_back(buildFclPair(treeOf(name), model.scalarKind(), a, b));
    const std::unique_ptr<BocstPair> ours = makeBocstPair(model.scalarKind(), a, b, model.options());

    PoseSampler sampler(*mesh_a, *mesh_b, *all.front(), seed);
    Count count;
    {
      Progress progress("pose", poses);
      for (std::size_t i = 0; i < poses; ++i) {
        const Pose pose = sampler.nextAroundContact();
        try {
          check(pose, *ours, all, count);
        } catch (const std::exception& e) {
          throw std::runtime_error(std::string(e.what()) + " (pose " + pose.text() + ")");
        }
        progress.step();
      }
    }

    if (output.wantsJson()) {
      Json report = {{"a", file_a},
                     {"b", file_b},
                     {"options", model.json()},
                     {"oracle", ours->oracleName()},
                     {"reference", references},
                     {"contacts_compared", compare_contacts},
                     {"seed", seed},
                     {"poses", poses},
                     {"reference_hits", count.reference_hits},
                     {"hits", count.hits},
                     {"false_negatives", count.false_negatives},
                     {"false_positives", count.false_positives},
                     {"order_differences", count.order_differences},
                     {"reference_order_differences", count.reference_order_differences},
                     {"contact_differences", count.contact_differences},
                     {"lost_by_fcl", count.lost_by_fcl},
                     {"mismatches", count.mismatches},
                     {"failures", Json::array()}};
      for (const Failure& failure : count.failures) {
        report["failures"].push_back({{"pose", failure.pose.numbers}, {"what", failure.what}});
      }
      output.write(report);
    } else {
      Table table;
      const auto row = [&table](const char* name, std::size_t n) { table.row({name, std::to_string(n)}); };
      row("poses", poses);
      row("reference hits", count.reference_hits);
      row("bocst hits", count.hits);
      row("false negatives", count.false_negatives);
      row("false positives", count.false_positives);
      row("argument order matters", count.order_differences);
      row("argument order matters to FCL", count.reference_order_differences);
      if (compare_contacts) row("sets of contacts differ", count.contact_differences);
      if (model.scalarKind() == Scalar::kFloat) row("contacts lost by FCL", count.lost_by_fcl);
      row("mismatches", count.mismatches);
      table.print();
      for (const Failure& failure : count.failures) {
        std::cout << failure.what << ": --pose " << failure.pose.text() << '\n';
      }
    }
    if (count.mismatches == 0) return 0;
    throw std::runtime_error(std::to_string(count.mismatches) + " of " + std::to_string(poses) +
                             " poses answered wrongly, the first (" + count.failures.front().what + ") at --pose " +
                             count.failures.front().pose.text());
  }
};

}  // namespace

void addValidate(CLI::App& program, Job& job) {
  auto validate = std::make_shared<Validate>();
  CLI::App* command = program.add_subcommand("validate", "compare answers with FCL's on many poses around contact");
  command->footer(
      "Of eight poses, six are off contact by 1e-9 to 1e-1 of the smaller radius, to both sides; two are anywhere.\n"
      "Every pose is asked in both argument orders, FCL too. A mismatch is a false negative; with exact answers also "
      "a\n"
      "false positive or another set of contacts; with conservative ones also a verdict that depends on the order.\n"
      "With --scalar float, pairs that FCL's trees cull though its own triangle test finds them touching do not "
      "count.\n"
      "Exit code 0 means that there was no mismatch.");
  command->add_option("a", validate->file_a, "mesh A: OBJ, PLY, STL, OFF or DAE file")->required();
  command->add_option("b", validate->file_b, "mesh B")->required();
  command->add_option("--poses", validate->poses, "number of poses")->check(CLI::PositiveNumber)->capture_default_str();
  command->add_option("--seed", validate->seed, "the same seed gives the same poses")->capture_default_str();
  command->add_flag("--contacts", validate->compare_contacts, "compare the sets of triangle pairs too");
  command->add_option("--reference", validate->references, "FCL's trees to compare with: obbrss, obb, rss (slow)")
      ->delimiter(',')
      ->check(CLI::IsMember({"obbrss", "obb", "rss"}))
      ->capture_default_str();
  validate->model.addAll(*command);
  addJson(*command, validate->output);
  command->callback([validate, &job] {
    if (validate->compare_contacts && !validate->model.exact()) {
      throw CLI::ValidationError("--contacts", "only exact answers have triangle pairs");
    }
    job = [validate] { return validate->run(); };
  });
}

}  // namespace bocst::program
