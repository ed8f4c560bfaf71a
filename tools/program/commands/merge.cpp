// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "commands/validation.h"

namespace bocst::program {
namespace {

struct Merge {
  std::vector<std::string> files;
  Output output;

  int run() const {
    output.check(files);
    std::vector<Validation> parts;
    for (const std::string& file : files) {
      const Json json = Json::parse(readFile(file), nullptr, false);
      if (json.is_discarded()) throw std::runtime_error(file + ": not JSON");
      try {
        parts.push_back(Validation::fromJson(json));
      } catch (const std::runtime_error& e) {
        throw std::runtime_error(file + ": " + e.what());
      }
    }
    const Validation all = Validation::merged(parts);
    if (output.wantsJson()) {
      output.write(all.json());
    } else {
      all.print();
    }
    all.throwIfWrong();
    return 0;
  }
};

}  // namespace

void addMerge(CLI::App& program, Job& job) {
  auto merge = std::make_shared<Merge>();
  CLI::App* command = program.add_subcommand("merge", "merge the reports of all shards of a validation");
  command->footer(
      "The reports are those of `bocst validate ... --shard i/n --json REPORT` for i from 1 to n. The result is the\n"
      "same as that of one run without --shard, including the exit code.");
  command->add_option("report", merge->files, "JSON report of each shard of one run")->required()->type_name("REPORT");
  addJson(*command, merge->output);
  command->callback([merge, &job] { job = [merge] { return merge->run(); }; });
}

}  // namespace bocst::program
