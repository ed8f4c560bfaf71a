// SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string>

#include "cli/arguments.h"
#include "cli/file.h"

namespace {

int complain(std::string what, int code) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  std::cerr << "bocst: " << what << std::endl;
  return code;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace bocst::program;
  cleanUpOnSignals();
  constexpr int kFailed = 1;
  constexpr int kUsage = 2;
  Job job;
  CLI::App program("Sphere-trees that grow on demand: collision queries, measurements and comparisons with FCL.",
                   "bocst");
  program.require_subcommand(1);
  program.set_version_flag("--version", "bocst " BOCST_VERSION);
  program.footer("Exit code: 0 when all is well, 1 when something failed or was missed, 2 for a wrong command line.");
  addCollide(program, job);
  addInspect(program, job);
  addValidate(program, job);
  addMerge(program, job);
  addBench(program, job);
  addPaper(program, job);
  addOracles(program, job);
  addManual(program, job);
  try {
    program.parse(argc, argv);
    const int code = job();
    if (!std::cout.flush()) throw std::runtime_error("stdout: cannot be written");
    return code;
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return program.exit(e);  // --help, --version
    return complain(e.what(), kUsage);
  } catch (const std::bad_alloc&) {
    return complain("out of memory", kFailed);
  } catch (const std::exception& e) {
    return complain(e.what(), kFailed);
  }
}
