// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <string>
#include <utility>
#include <vector>

#include "cli/report.h"
#include "pairs/poses.h"

namespace bocst::program {

/// A value of a JSON file that knows its place, so that each complaint names it: "scene.json: objects[2].pose".
class JsonElement {
 public:
  /// @param json must outlive this, as `warnings`, which pose() adds to.
  JsonElement(const Json& json, std::string file, std::vector<std::string>& warnings)
      : json_(json), file_(std::move(file)), warnings_(warnings) {}

  /// @throws std::runtime_error always.
  [[noreturn]] void complain(const std::string& what) const;

  bool isText() const { return json_.is_string(); }
  bool isNumber() const { return json_.is_number(); }
  bool isList() const { return json_.is_array(); }
  bool isObject() const { return json_.is_object(); }

  // All throw std::runtime_error where the value is of another kind.

  std::string text() const;
  double number() const;
  bool boolean() const;
  std::vector<JsonElement> items() const;                            ///< Of a list.
  std::vector<std::pair<std::string, JsonElement>> members() const;  ///< Of an object.
  std::vector<double> numbers(std::size_t count) const;              ///< A list of `count`.
  /// [x, y, z], [x, y, z, qw, qx, qy, qz], or {"xyz": [...], "rpy" or "wxyz" or "xyzw": [...]}.
  Eigen::Isometry3d pose() const;

  bool has(const char* key) const { return json_.is_object() && json_.contains(key); }
  JsonElement at(const std::string& key) const;
  void allowKeys(const std::vector<std::string>& keys) const;  ///< It is an object without others.

 private:
  JsonElement part(const Json& json, const std::string& step) const;
  std::string placed(const std::string& what) const;

  const Json& json_;
  std::string file_;
  std::string path_;
  std::vector<std::string>& warnings_;
};

}  // namespace bocst::program
