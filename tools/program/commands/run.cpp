// SPDX-License-Identifier: BSD-3-Clause
#include "commands/run.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <exception>
#include <iostream>
#include <new>
#include <stdexcept>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/file.h"
#include "cli/printable.h"
#include "cli/suggest.h"
#include "cli/words.h"

namespace bocst::program {
namespace {

int complain(std::string what, int code) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  std::cerr << "bocst: " << printable(what) << std::endl;
  return code;
}

/// The names of commands that are shown.
std::vector<std::string> commandNames(const CLI::App& program) {
  std::vector<std::string> names;
  for (const CLI::App* command : program.get_subcommands(nullptr)) {
    if (!command->get_group().empty()) names.push_back(command->get_name());
  }
  return names;
}

std::string commandList(const CLI::App& program) { return joined(commandNames(program), ", "); }

/// The complaint about a word that is no command, no option or too much.
std::string unexpected(const CLI::App& program) {
  const std::vector<CLI::App*> given = program.get_subcommands();
  const std::vector<std::string> left = program.remaining(true);
  if (left.empty()) return "wrong command line; see `bocst --help`";
  const std::string word = left.front().substr(0, left.front().find('='));
  if (given.empty()) {
    if (word.front() == '-') return "there is no option " + word + "; see `bocst --help`";
    return "there is no command " + word + "." + suggestion(word, commandNames(program)) + " See `bocst --help`";
  }
  const std::string command = given.front()->get_name();
  const std::string help = " See `bocst " + command + " --help`";
  if (word.front() != '-') return command + ": " + word + ": unexpected." + help;
  std::vector<std::string> names{"--help"};
  for (const CLI::Option* option : given.front()->get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return command + ": there is no option " + word + "." + suggestion(word, names) + help;
}

/// An unset variable of a script must not count as an option that is not given.
void refuseEmptyValues(CLI::App& program) {
  for (CLI::App* command : program.get_subcommands(nullptr)) {
    for (CLI::Option* option : command->get_options()) {
      const auto check = [](const std::string& value) { return value.empty() ? "is empty; give a value" : ""; };
      if (option->get_items_expected_max() > 0) option->check(CLI::Validator(check, "", "not empty"));
    }
  }
}

/// "bocst help" and "bocst help COMMAND" are the same as with --help.
std::vector<std::string> argumentsOf(int argc, char** argv, const CLI::App& program) {
  std::vector<std::string> words(argv + 1, argv + argc);
  if (!words.empty() && words[0] == "help") {
    const auto all = program.get_subcommands(nullptr);
    const auto is_named = [&](const CLI::App* command) { return command->get_name() == words.back(); };
    if (words.size() > 1 && std::none_of(all.begin(), all.end(), is_named)) return {words.back()};
    words.erase(words.begin());
    words.insert(words.begin() + (words.empty() ? 0 : 1), "--help");
  }
  return {words.rbegin(), words.rend()};  // as CLI11 takes them
}

}  // namespace

int run(int argc, char** argv, const std::string& version) {
  cleanUpOnSignals();
  constexpr int kFailed = 1;
  constexpr int kUsage = 2;
  const char* const kNoOutput = "stdout: cannot be written";
  Job job;
  CLI::App program("Collision queries with sphere-trees that grow on demand, measurements and comparisons with FCL.",
                   "bocst");
  program.require_subcommand(1);
  program.set_version_flag("--version", "bocst " + version);
  program.footer(
      "`bocst COMMAND --help` lists the options of a command; `bocst man` writes the manual, `bocst completion` the\n"
      "completion for bash. " +
      meshFormats() +
      "\n"
      "Exit code: 0 for success, 1 if something failed or an answer was wrong, 2 for a wrong command line.");
  addCollide(program, job);
  addInspect(program, job);
  addValidate(program, job);
  addMerge(program, job);
  addScene(program, job);
  addBench(program, job);
  addPaper(program, job);
  addOracles(program, job);
  addManual(program, job);
  try {
    refuseEmptyValues(program);
    program.parse(argumentsOf(argc, argv, program));
    const int code = job();
    if (!std::cout.flush()) throw std::runtime_error(kNoOutput);
    return code;
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) {  // --help, --version
      const int code = program.exit(e);
      return std::cout.flush() ? code : complain(kNoOutput, kFailed);
    }
    // CLI11 looks for a command before it looks at words that are left.
    if (argc > 1 && (dynamic_cast<const CLI::ExtrasError*>(&e) != nullptr || program.get_subcommands().empty())) {
      return complain(unexpected(program), kUsage);
    }
    if (argc == 1)
      return complain("a command is missing, one of: " + commandList(program) + "; see `bocst --help`", kUsage);
    return complain(e.what(), kUsage);
  } catch (const std::bad_alloc&) {
    return complain("out of memory; smaller meshes, or a smaller --depth, need less", kFailed);
  } catch (const std::exception& e) {
    return complain(e.what(), kFailed);
  }
}

}  // namespace bocst::program
