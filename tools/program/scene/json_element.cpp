// SPDX-License-Identifier: BSD-3-Clause
#include "scene/json_element.h"

#include <algorithm>
#include <array>
#include <stdexcept>

#include "cli/printable.h"
#include "cli/suggest.h"

namespace bocst::program {

std::string JsonElement::placed(const std::string& what) const {
  return printable(file_ + ": " + (path_.empty() ? "" : path_ + ": ") + what);
}

void JsonElement::complain(const std::string& what) const { throw std::runtime_error(placed(what)); }

JsonElement JsonElement::part(const Json& json, const std::string& step) const {
  JsonElement element(json, file_, warnings_);
  element.path_ = path_.empty() && step.front() == '.' ? step.substr(1) : path_ + step;
  return element;
}

std::string JsonElement::text() const {
  if (!json_.is_string()) complain("a text (\"...\") expected");
  return json_.get<std::string>();
}

double JsonElement::number() const {
  if (!json_.is_number()) complain("a number expected");
  return json_.get<double>();
}

bool JsonElement::boolean() const {
  if (!json_.is_boolean()) complain("true or false expected");
  return json_.get<bool>();
}

std::vector<JsonElement> JsonElement::items() const {
  if (!json_.is_array()) complain("a list expected");
  std::vector<JsonElement> elements;
  for (std::size_t i = 0; i < json_.size(); ++i) elements.push_back(part(json_[i], "[" + std::to_string(i) + "]"));
  return elements;
}

std::vector<std::pair<std::string, JsonElement>> JsonElement::members() const {
  if (!json_.is_object()) complain("an object {...} expected");
  std::vector<std::pair<std::string, JsonElement>> elements;
  for (const auto& [key, value] : json_.items()) elements.emplace_back(key, part(value, "." + key));
  return elements;
}

std::vector<double> JsonElement::numbers(std::size_t count) const {
  std::vector<double> list;
  if (json_.is_array() && json_.size() == count) {
    for (const JsonElement& item : items()) list.push_back(item.number());
    return list;
  }
  complain("a list of " + std::to_string(count) + " numbers expected");
}

Eigen::Isometry3d JsonElement::pose() const {
  std::array<double, 7> numbers{0, 0, 0, 1, 0, 0, 0};
  RotationFormat format = RotationFormat::kWxyz;
  const auto fill = [&](const JsonElement& element, std::size_t begin, std::size_t count) {
    const std::vector<double> list = element.numbers(count);
    std::copy(list.begin(), list.end(), numbers.begin() + static_cast<std::ptrdiff_t>(begin));
  };
  if (isList() && (json_.size() == 3 || json_.size() == 7)) {
    fill(*this, 0, json_.size());
  } else {
    if (!isObject()) complain("a list of 3 or 7 numbers or {\"xyz\": [x, y, z], \"rpy\": [roll, pitch, yaw]} expected");
    allowKeys({"xyz", "rpy", "wxyz", "xyzw"});
    if (has("xyz")) fill(at("xyz"), 0, 3);
    if (has("rpy") + has("wxyz") + has("xyzw") > 1)
      complain("one rotation expected, not several of rpy, wxyz and xyzw");
    if (has("wxyz")) fill(at("wxyz"), 3, 4);
    if (has("xyzw")) fill(at("xyzw"), 3, 4);
    if (has("rpy")) fill(at("rpy"), 3, 3);
    format = has("xyzw") ? RotationFormat::kXyzw : has("rpy") ? RotationFormat::kRpy : RotationFormat::kWxyz;
  }
  try {
    const Pose pose = Pose::of(numbers, format);
    const std::string warning = normWarning(pose);
    if (!warning.empty()) warnings_.push_back(placed(warning));
    return pose.transform();
  } catch (const std::invalid_argument& e) {
    complain(e.what());
  }
}

JsonElement JsonElement::at(const std::string& key) const {
  if (!json_.is_object()) complain("an object {...} expected");
  if (!json_.contains(key)) complain("\"" + key + "\" is missing");
  return part(json_[key], "." + key);
}

void JsonElement::allowKeys(const std::vector<std::string>& keys) const {
  for (const auto& [key, element] : members()) {
    if (std::find(keys.begin(), keys.end(), key) == keys.end()) {
      complain("there is no key \"" + key + "\" here." + suggestion(key, keys));
    }
  }
}

}  // namespace bocst::program
