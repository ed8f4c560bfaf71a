// SPDX-License-Identifier: BSD-3-Clause
#include "robot/srdf.h"

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <vector>

#include "cli/suggest.h"
#include "robot/xml_file.h"

namespace bocst::program {
namespace {

std::string withoutOuterBlanks(const std::string& text) {
  constexpr const char* kBlanks = " \t\r\n";
  const std::size_t begin = text.find_first_not_of(kBlanks);
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

class SrdfReader {
 public:
  SrdfReader(const XmlFile& xml, const Robot& robot) : xml_(xml), robot_(robot) {}

  Srdf read() {
    xml_.refuseXacro("robot.srdf");
    for (const char* name : {"link", "joint"}) {
      const pugi::xml_node element = xml_.root().child(name);
      if (element) throw std::runtime_error(xml_.place(element) + ": <" + name + "> belongs to a URDF, not to an SRDF");
    }
    const std::string robot = xml_.root().attribute("name").value();
    if (robot != robot_.name()) {
      srdf_.warnings.push_back(xml_.place(xml_.root()) + ": the SRDF is of robot \"" + robot + "\", the URDF of \"" +
                               robot_.name() + "\"");
    }
    refuseMisspelledNames();
    for (const pugi::xml_node& element : xml_.root().children("disable_default_collisions")) {
      const std::optional<std::size_t> link = linkOf(element, "link");
      if (link) srdf_.unchecked.push_back(*link);
      for (std::size_t other = 0; link && other < robot_.links().size(); ++other) {
        if (other != *link) srdf_.disabled.insert(std::minmax(*link, other));
      }
    }
    for (const pugi::xml_node& element : xml_.root().children("enable_collisions")) {
      if (const auto pair = pairOf(element)) srdf_.disabled.erase(*pair);
    }
    for (const pugi::xml_node& element : xml_.root().children("disable_collisions")) {
      if (const auto pair = pairOf(element)) srdf_.disabled.insert(*pair);
    }
    return std::move(srdf_);
  }

 private:
  // Other elements may be of any extension of SRDF.
  void refuseMisspelledNames() const {
    const std::vector<std::string> read = {"disable_collisions", "disable_default_collisions", "enable_collisions"};
    constexpr std::size_t kMostWrongLetters = 3;
    for (const pugi::xml_node& element : xml_.root().children()) {
      const std::string name = element.name();
      if (std::find(read.begin(), read.end(), name) != read.end()) continue;
      const std::string near = suggestion(name, read, kMostWrongLetters);
      if (!near.empty())
        throw std::runtime_error(xml_.place(element) + ": <robot> has no element <" + name + ">." + near);
    }
  }

  std::optional<std::size_t> linkOf(const pugi::xml_node& element, const char* attribute) {
    const std::string name = withoutOuterBlanks(xml_.attribute(element, attribute));
    const auto& links = robot_.links();
    const auto found = std::find_if(links.begin(), links.end(), [&](const Part& link) { return link.name == name; });
    if (found != links.end()) return static_cast<std::size_t>(found - links.begin());
    srdf_.warnings.push_back(xml_.place(element) + ": the robot has no link " + name + "; the element is skipped");
    return std::nullopt;
  }

  std::optional<std::pair<std::size_t, std::size_t>> pairOf(const pugi::xml_node& element) {
    const std::optional<std::size_t> a = linkOf(element, "link1");
    const std::optional<std::size_t> b = linkOf(element, "link2");
    if (!a || !b) return std::nullopt;
    return std::minmax(*a, *b);
  }

  const XmlFile& xml_;
  const Robot& robot_;
  Srdf srdf_;
};

}  // namespace

Srdf readSrdf(const std::string& file, const Robot& robot) {
  const XmlFile xml(file);
  xml.expectRoot("robot");
  return SrdfReader(xml, robot).read();
}

}  // namespace bocst::program
