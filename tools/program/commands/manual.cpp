// SPDX-License-Identifier: BSD-3-Clause
// The man page and the completion of the shell, both made from the options themselves. Hidden commands; the build runs
// them.
#include <bocst/io.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "cli/arguments.h"
#include "cli/report.h"
#include "cli/words.h"

namespace bocst::program {
namespace {

/// What the man page says beyond the options.
constexpr const char* kDescription =
    "A bocst model is a collision geometry for FCL: a sphere-tree that starts as one sphere and grows where queries "
    "need it. This program inspects meshes, runs single queries, and compares answers, time and memory with FCL's.";
constexpr const char* kExitStatus =
    "0 for success, 1 if something failed or an answer was wrong, 2 for a wrong command line.";
constexpr const char* kFiles = "An output file is written completely or not at all.";
constexpr std::pair<const char*, const char*> kEnvironment[] = {
    {"BOCST_ORACLE", "cpu, occlusion, compute or the number of a device: the oracle that --oracle auto uses."},
    {"BOCST_DISPATCH_CHECK", "off: do not check, when a model is made, that FCL's entry points reach bocst."},
};
constexpr std::pair<const char*, const char*> kExamples[] = {
    {"bocst collide link.obj gripper.obj", "Check two meshes for collision; their frames coincide."},
    {"bocst inspect link.obj --depth 6 --html link.html", "Write a page that shows the sphere-tree."},
    {"bocst collide link.obj gripper.obj --image pair.png",
     "Draw the contacts and the nodes that the query has grown."},
    {"bocst inspect link.obj --depth 5 --spheres link.yaml", "Write collision spheres for a GPU planner."},
    {"bocst paper bunny00.off ChineseDragon-10kv.off --out paper",
     "Compare the paper's tables and figures with bocst's."},
    {"bocst bench link.obj gripper.obj --scenarios all --csv figures.csv",
     "Compare time and memory with FCL's, as a table."},
    {"bocst scene arm.urdf --srdf arm.srdf --states path.csv --html arm.html",
     "Check which states of a robot collide, and with which objects; write a page that shows them."},
    {"bocst validate link.obj gripper.obj --poses 10000 --shard 1/4 --json 1.json", "Run a quarter of a validation."},
};

std::vector<const CLI::App*> commandsOf(const CLI::App& program) {
  return program.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

/// But --help, which all have.
std::vector<const CLI::Option*> optionsOf(const CLI::App& command, bool positional) {
  return command.get_options([&command, positional](const CLI::Option* option) {
    return option->get_positional() == positional && option != command.get_help_ptr();
  });
}

/// {a,b} of a type's name, which CLI11 writes for IsMember; empty without.
std::vector<std::string> choicesOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t open = type.find('{');
  std::vector<std::string> choices;
  if (open == std::string::npos) return choices;
  std::istringstream inside(type.substr(open + 1, type.find('}') - open - 1));
  for (std::string choice; std::getline(inside, choice, ',');) choices.push_back(choice);
  return choices;
}

bool takesFile(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.rfind("FILE", 0) == 0 || type.rfind("DIR", 0) == 0;
}

/// A value as the man page names it: the choices, a number, or what the option itself says.
std::string valueOf(const CLI::Option& option) {
  if (option.get_items_expected_max() == 0) return "";
  const std::string choices = joined(choicesOf(option), "|");
  if (!choices.empty()) return choices;
  const std::string type = option.get_type_name();
  const std::string basic = type.substr(0, type.find(':'));
  if (basic == "INT" || basic == "UINT") return "N";
  if (basic == "FLOAT") return "X";
  return type;
}

/// " From 1 to 17." of an option with a range.
std::string rangeOf(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t open = type.find(" in [");
  if (open == std::string::npos) return "";
  const std::size_t dash = type.find(" - ", open);
  return " From " + type.substr(open + 5, dash - open - 5) + " to " + type.substr(dash + 3, type.find(']') - dash - 3) +
         ".";
}

std::string defaultOf(const CLI::Option& option) {
  std::string text = option.get_default_str();
  if (!text.empty() && text.front() == '[') text = text.substr(1, text.size() - 2);
  return text.empty() ? "" : " Default: " + text + ".";
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::toupper(c); });
  return text;
}

/// Text as roff takes it: one paragraph, with hyphens that can be searched for.
std::string roff(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '\\') {
      result += "\\e";
    } else if (c == '-') {
      result += "\\-";
    } else {
      result += c == '\n' ? ' ' : c;
    }
  }
  return !result.empty() && (result[0] == '.' || result[0] == '\'') ? "\\&" + result : result;
}

std::string sentence(std::string text) {
  if (!text.empty() && text.back() != '.') text += '.';
  return text;
}

std::string capital(std::string text) {
  if (!text.empty()) text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
  return text;
}

std::string entry(const std::string& head, const std::string& text) {
  return ".TP\n" + head + "\n" + roff(text) + "\n";
}

std::string manPage(const CLI::App& program) {
  std::string text = ".TH BOCST 1 \"\" \"" + program.version() + "\" \"User Commands\"\n.SH NAME\nbocst \\- " +
                     roff("sphere-trees that grow on demand: inspect, collide, compare with FCL") +
                     "\n.SH SYNOPSIS\n.B bocst\n.I command\n.RI [ options ]\n.I argument ...\n.SH DESCRIPTION\n" +
                     roff(kDescription) + "\n.SH COMMANDS\n";
  for (const CLI::App* command : commandsOf(program)) {
    std::string synopsis = "bocst " + command->get_name() + " [options]";
    for (const CLI::Option* argument : optionsOf(*command, true)) {
      const std::string name = upper(argument->get_name(true)) + (argument->get_items_expected_max() > 1 ? " ..." : "");
      synopsis += argument->get_required() ? " " + name : " [" + name + "]";
    }
    text += ".SS \"" + roff(synopsis) + "\"\n" + roff(capital(sentence(command->get_description()))) + "\n";
    // CLI11 hands the program's own footer down.
    if (!command->get_footer().empty() && command->get_footer() != program.get_footer())
      text += ".PP\n" + roff(command->get_footer()) + "\n";
    for (const CLI::Option* argument : optionsOf(*command, true)) {
      text += entry(".I " + roff(upper(argument->get_name(true))), sentence(argument->get_description()));
    }
    for (const CLI::Option* option : optionsOf(*command, false)) {
      std::string head = ".B " + roff(option->get_name(false, true));
      if (!valueOf(*option).empty()) head += "\\fR \\fI" + roff(valueOf(*option));
      text += entry(head, sentence(option->get_description()) + rangeOf(*option) + defaultOf(*option));
    }
  }
  text +=
      ".SH OPTIONS\n" +
      entry(".B \\-h\\fR, \\fB\\-\\-help", "Lists the options of a command; without a command, lists the commands.") +
      entry(".B \\-\\-version", "Prints the version of the program.");
  text += ".SH \"EXIT STATUS\"\n" + roff(kExitStatus) + "\n.SH ENVIRONMENT\n";
  for (const auto& [name, meaning] : kEnvironment) text += entry(std::string(".B ") + name, meaning);
  text += ".SH FILES\n" + roff(meshFormats() + " " + kFiles) + "\n.SH EXAMPLES\n";
  for (const auto& [line, meaning] : kExamples) text += entry(".B " + roff(line), meaning);
  return text;
}

std::string words(const std::vector<std::string>& list) { return joined(list, " "); }

std::string meshEndings() {
  return joined(bocst::meshFormats(), " ", [](const MeshFormat& format) { return format.ending; });
}

std::string completion(const CLI::App& program) {
  std::vector<std::string> names;
  std::string values;
  std::string options;
  for (const CLI::App* command : commandsOf(program)) {
    names.push_back(command->get_name());
    std::vector<std::string> long_names{"--help"};
    for (const CLI::Option* option : optionsOf(*command, false)) {
      const std::string name = "--" + option->get_lnames().at(0);
      long_names.push_back(name);
      if (option->get_items_expected_max() == 0) continue;
      std::string act;
      if (takesFile(*option)) act = "_bocst_files; ";
      if (!choicesOf(*option).empty()) act = "_bocst_words '" + words(choicesOf(*option)) + "'; ";
      values += "    '" + command->get_name() + " " + name + "') " + act + "return ;;\n";
    }
    options += "    " + command->get_name() + ") _bocst_words '" + words(long_names) + "' ;;\n";
  }
  return R"(# Completion of bocst for bash, made by `bocst completion`.
_bocst_words() { mapfile -t COMPREPLY < <(compgen -W "$1" -- "$word"); }

# Folders, and files with one of these endings; without any, all files.
_bocst_files() {
  local name ending
  while IFS= read -r name; do
    ending=${name##*.}
    if [[ $# == 0 || -d $name || " $* " == *" ${ending,,} "* ]]; then COMPREPLY+=("$name"); fi
  done < <(compgen -f -- "$word")
}

_bocst() {
  local word=${COMP_WORDS[COMP_CWORD]} command=${COMP_WORDS[1]}
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    _bocst_words ')" +
         words(names) + R"( --help --version'
    return
  fi
  case "$command ${COMP_WORDS[COMP_CWORD - 1]}" in
)" + values +
         R"(  esac
  if [[ $word != -* ]]; then
    case $command in
      merge) _bocst_files json ;;
      scene) _bocst_files json urdf xml ;;
      *) _bocst_files )" +
         meshEndings() + R"( ;;
    esac
    return
  fi
  case $command in
)" + options +
         R"(  esac
}

complete -o filenames -F _bocst bocst
)";
}

/// A command that writes a text about the program itself.
void add(CLI::App& program, Job& job, const char* name, std::string (*text)(const CLI::App&)) {
  auto file = std::make_shared<std::string>("-");
  CLI::App* command = program.add_subcommand(name)->group("");
  command->add_option("file", *file, "output file; - is stdout");
  command->callback([&program, &job, file, text] {
    job = [&program, file, text] {
      writeText(*file, text(program));
      return 0;
    };
  });
}

}  // namespace

void addManual(CLI::App& program, Job& job) {
  add(program, job, "man", manPage);
  add(program, job, "completion", completion);
}

}  // namespace bocst::program
