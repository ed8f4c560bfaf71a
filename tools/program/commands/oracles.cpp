// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/oracle.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <string>

#include "cli/arguments.h"
#include "oracle/oracle.h"

namespace bocst::program {

void addOracles(CLI::App& program, Job& job) {
  auto output = std::make_shared<Output>();
  CLI::App* command = program.add_subcommand(
      "oracles", "list the backends that subdivide cells (oracles), and why some cannot be used");
  addJson(*command, *output);
  command->callback([output, &job] {
    job = [output] {
      output->check();
      Json report = {{"oracles", Json::array()}};
      Table table(Table::Others::kLeft);
      table.row({"oracle", "hardware", "usable", "self-test", "device"});
      for (const OracleInfo& oracle : availableOracles()) {
        report["oracles"].push_back({{"name", oracle.name},
                                     {"device", oracle.device},
                                     {"hardware", oracle.hardware},
                                     {"usable", oracle.why_not.empty()},
                                     {"why_not", oracle.why_not},
                                     {"self_test", oracle.self_test}});
        table.row({oracle.name, oracle.hardware ? "yes" : "no",
                   oracle.why_not.empty() ? "yes" : "no: " + oracle.why_not, oracle.self_test, oracle.device});
      }
      // What a model takes that leaves the choice open.
      std::string automatic, conservative, why_not;
      try {
        automatic = oracle::makeOracle(OracleKind::kAuto)->name();
        conservative = oracle::makeOracle(OracleKind::kAuto, Answer::kConservative)->name();
      } catch (const OracleError& e) {
        why_not = e.what();
      }
      report["auto"] = why_not.empty() ? Json(automatic) : Json();
      report["auto_conservative"] = why_not.empty() ? Json(conservative) : Json();
      if (!why_not.empty()) report["auto_why_not"] = why_not;
      if (output->wantsJson()) {
        output->write(report);
      } else {
        table.print();
        std::cout << "\nauto takes "
                  << (!why_not.empty() ? "none: " + why_not
                      : automatic == conservative
                          ? automatic
                          : automatic + " for exact answers, " + conservative + " for conservative ones")
                  << '\n';
      }
      return 0;
    };
  });
}

}  // namespace bocst::program
