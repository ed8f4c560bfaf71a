// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/oracle.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "arguments.h"

namespace bocst::program {

void addOracles(CLI::App& program, Job& job) {
  auto output = std::make_shared<Output>();
  CLI::App* command = program.add_subcommand("oracles", "list the oracles of this machine, and why others are missing");
  addJson(*command, *output);
  command->callback([output, &job] {
    job = [output] {
      output->check();
      Json report = {{"oracles", Json::array()}};
      Table table(Table::Others::kLeft);
      table.row({"oracle", "hardware", "usable", "device"});
      for (const OracleInfo& oracle : availableOracles()) {
        report["oracles"].push_back({{"name", oracle.name},
                                     {"device", oracle.device},
                                     {"hardware", oracle.hardware},
                                     {"usable", oracle.why_not.empty()},
                                     {"why_not", oracle.why_not}});
        table.row({oracle.name, oracle.hardware ? "yes" : "no",
                   oracle.why_not.empty() ? "yes" : "no: " + oracle.why_not, oracle.device});
      }
      if (output->wantsJson()) {
        output->write(report);
      } else {
        table.print();
      }
      return 0;
    };
  });
}

}  // namespace bocst::program
