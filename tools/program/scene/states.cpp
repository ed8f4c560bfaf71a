// SPDX-License-Identifier: BSD-3-Clause
#include "scene/states.h"

#include <algorithm>
#include <array>
#include <sstream>
#include <stdexcept>

#include "cli/printable.h"
#include "cli/suggest.h"
#include "cli/words.h"
#include "io/text.h"
#include "pairs/cells.h"
#include "pairs/poses.h"

namespace bocst::program {
namespace {

constexpr std::array<const char*, 10> kFields = {"x", "y", "z", "qw", "qx", "qy", "qz", "roll", "pitch", "yaw"};
constexpr unsigned kPosition = 0x007, kQuaternion = 0x078, kAngles = 0x380;  // bits of kFields

/// What to write for a moving object.
std::string neededColumns(const std::string& object) {
  const auto column = [&object](const char* field) { return object + "." + field; };
  const auto columns = [&](std::size_t begin, std::size_t end) {
    return joined(std::vector<const char*>(kFields.begin() + begin, kFields.begin() + end), ", ", column);
  };
  return printable("object " + object + " needs the columns " + columns(0, 3) + ", and for a rotation " +
                   columns(3, 7) + " or " + columns(7, 10));
}

/// Why a name is not that of a column (`fields`: object.x and so on) or of a key.
std::string refusal(const std::string& name, const StateNames& names, bool fields) {
  if (name.empty()) return fields ? "a column has no name" : "a name is empty";
  const auto joint = names.others.find(name);
  if (joint != names.others.end()) return "joint " + name + " " + joint->second + ", so it must not be given";
  if (fields && std::count(names.objects.begin(), names.objects.end(), name) > 0) return neededColumns(name);
  const std::string unknown = "no moving joint or object is called " + inQuotes(name) + ".";
  const std::size_t dot = name.rfind('.');
  std::vector<std::string> known = names.joints;
  for (const std::string& object : names.objects) {
    if (!fields && object == name.substr(0, dot)) return unknown + " Write \"" + object + "\": [x, y, z].";
    if (!fields || dot == std::string::npos) {
      known.push_back(object);
    } else {
      for (const char* field : kFields) known.push_back(object + "." + field);
    }
  }
  return unknown + suggestion(name, known);
}

/// The table, once its first line is read.
class Columns {
 public:
  Columns(const std::vector<std::string>& head, const StateNames& names)
      : names_(names), given_(names.objects.size(), 0u) {
    for (const std::string& name : head) columns_.push_back(columnOf(name));
    for (std::size_t i = 0; i < columns_.size(); ++i) {
      for (std::size_t k = 0; k < i; ++k) {
        if (head[i] == head[k]) throw std::invalid_argument("column " + printable(head[i]) + " occurs twice");
      }
    }
    std::vector<std::string> missing;
    for (std::size_t j = 0; j < names.joints.size(); ++j) {
      const auto is = [j](const Column& c) { return !c.object && c.index == j; };
      if (std::none_of(columns_.begin(), columns_.end(), is)) missing.push_back(names.joints[j]);
    }
    if (!missing.empty()) throw std::invalid_argument("columns are missing: " + printable(joined(missing, ", ")));
    for (std::size_t i = 0; i < given_.size(); ++i) checkObject(i);
  }

  State read(const std::vector<std::string>& cells, std::vector<std::string>& warnings) const {
    if (cells.size() != columns_.size()) {
      throw std::invalid_argument(counted(columns_.size(), "number") + " expected, " + std::to_string(cells.size()) +
                                  " found");
    }
    State state;
    state.joints.resize(names_.joints.size());
    std::vector<std::array<double, kFields.size()>> fields(given_.size(), {0, 0, 0, 1, 0, 0, 0, 0, 0, 0});
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::optional<double> number = numberOf(cells[i]);
      if (!number)
        throw std::invalid_argument("column " + printable(nameOf(columns_[i])) + ": " + inQuotes(cells[i]) +
                                    " is no finite number");
      const Column& column = columns_[i];
      (column.object ? fields[column.index][column.field] : state.joints[column.index]) = *number;
    }
    for (std::size_t i = 0; i < given_.size(); ++i) state.objects.push_back(poseOf(i, fields[i], warnings));
    return state;
  }

 private:
  struct Column {
    bool object;
    std::size_t index, field;
  };

  Column columnOf(const std::string& name) {
    const auto joint = std::find(names_.joints.begin(), names_.joints.end(), name);
    if (joint != names_.joints.end()) return {false, static_cast<std::size_t>(joint - names_.joints.begin()), 0};
    const std::size_t dot = name.rfind('.');
    for (std::size_t i = 0; dot != std::string::npos && i < names_.objects.size(); ++i) {
      if (names_.objects[i] != name.substr(0, dot)) continue;
      const auto field = std::find(kFields.begin(), kFields.end(), name.substr(dot + 1));
      if (field == kFields.end()) break;
      const Column column{true, i, static_cast<std::size_t>(field - kFields.begin())};
      given_[i] |= 1u << column.field;
      return column;
    }
    throw std::invalid_argument(refusal(name, names_, true));
  }

  std::string nameOf(const Column& column) const {
    if (!column.object) return names_.joints[column.index];
    return names_.objects[column.index] + "." + kFields[column.field];
  }

  void checkObject(std::size_t i) const {
    const unsigned given = given_[i];
    const std::string& name = names_.objects[i];
    if (given == 0 && !names_.X_WO[i]) throw std::invalid_argument(neededColumns(name));
    const bool whole =
        given == 0 || given == kPosition || given == (kPosition | kQuaternion) || given == (kPosition | kAngles);
    if (!whole) {
      throw std::invalid_argument(neededColumns(name));
    }
  }

  Eigen::Isometry3d poseOf(std::size_t i, const std::array<double, kFields.size()>& f,
                           std::vector<std::string>& warnings) const {
    if (given_[i] == 0) return *names_.X_WO[i];
    if ((given_[i] & kAngles) != 0)
      return Pose::of({f[0], f[1], f[2], f[7], f[8], f[9]}, RotationFormat::kRpy).transform();
    const Pose pose = Pose::of({f[0], f[1], f[2], f[3], f[4], f[5], f[6]});
    const std::string warning = normWarning(pose);
    if (!warning.empty()) warnings.push_back(names_.objects[i] + ": " + warning);
    return pose.transform();
  }

  const StateNames& names_;
  std::vector<Column> columns_;
  std::vector<unsigned> given_;  ///< Bits of kFields, of each object.
};

}  // namespace

State startState(const StateNames& names) {
  State state;
  state.place = "the start";
  state.joints.assign(names.joints.size(), 0.0);
  for (std::size_t i = 0; i < names.objects.size(); ++i) {
    if (!names.X_WO[i])
      throw std::runtime_error("no states are given, and object " + printable(names.objects[i]) + " has no pose");
    state.objects.push_back(*names.X_WO[i]);
  }
  return state;
}

std::vector<State> statesOfTable(const std::string& text, const StateNames& names, const std::string& file,
                                 std::vector<std::string>& warnings) {
  std::vector<State> states;
  std::optional<Columns> columns;
  bool blanks = false;
  std::istringstream stream{std::string(io::withoutByteOrderMark(text))};
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    const std::string place = "line " + std::to_string(number);
    try {
      std::vector<std::string> cells = cellsOf(line, blanks ? Blanks::kSeparate : Blanks::kKeep);
      if (cells.size() == 1 && cells[0].empty()) continue;
      if (columns) {
        std::vector<std::string> found;
        states.push_back(columns->read(cells, found));
        states.back().place = place;
        for (const std::string& warning : found) warnings.push_back(file + ": " + place + ": " + warning);
        continue;
      }
      // A joint may have a blank in its name.
      blanks = cells.size() == 1 && std::count(names.joints.begin(), names.joints.end(), cells[0]) == 0;
      if (blanks) cells = cellsOf(line, Blanks::kSeparate);
      if (numberOf(cells.front())) throw std::invalid_argument("the first line must have the names of the columns");
      columns.emplace(cells, names);
    } catch (const std::invalid_argument& e) {
      throw std::runtime_error(file + ": " + place + ": " + e.what());
    }
  }
  if (states.empty()) throw std::runtime_error(file + ": no states");
  return states;
}

State stateOfJson(const JsonElement& element, const StateNames& names) {
  State state;
  state.joints.resize(names.joints.size());
  std::vector<std::optional<double>> joints(names.joints.size());
  std::vector<std::optional<Eigen::Isometry3d>> objects = names.X_WO;
  for (const auto& [name, value] : element.members()) {
    const auto joint = std::find(names.joints.begin(), names.joints.end(), name);
    const auto object = std::find(names.objects.begin(), names.objects.end(), name);
    if (joint != names.joints.end()) {
      joints[static_cast<std::size_t>(joint - names.joints.begin())] = value.number();
    } else if (object != names.objects.end()) {
      objects[static_cast<std::size_t>(object - names.objects.begin())] = value.pose();
    } else {
      element.complain(refusal(name, names, false));
    }
  }
  std::vector<std::string> missing;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    if (!joints[i]) missing.push_back("joint " + names.joints[i]);
    state.joints[i] = joints[i].value_or(0);
  }
  for (std::size_t i = 0; i < objects.size(); ++i) {
    if (!objects[i]) missing.push_back("the pose of object " + names.objects[i]);
    state.objects.push_back(objects[i].value_or(Eigen::Isometry3d::Identity()));
  }
  if (!missing.empty()) element.complain("missing: " + joined(missing, ", "));
  return state;
}

}  // namespace bocst::program
