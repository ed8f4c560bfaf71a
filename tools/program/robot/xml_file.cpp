// SPDX-License-Identifier: BSD-3-Clause
#include "robot/xml_file.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "cli/file.h"

namespace bocst::program {

XmlFile::XmlFile(std::string file) : XmlFile(file, readFile(file)) {}

XmlFile::XmlFile(std::string file, std::string text) : file_(std::move(file)), text_(std::move(text)) {
  const pugi::xml_parse_result result = document_.load_buffer(text_.data(), text_.size());
  has_lines_ = result.encoding == pugi::encoding_utf8;
  if (!result) throw std::runtime_error(placeOf(result.offset) + ": no XML: " + result.description());
  for (pugi::xml_node next = root().next_sibling(); next; next = next.next_sibling()) {
    if (next.type() != pugi::node_element) continue;
    throw std::runtime_error(place(next) + ": <" + next.name() + "> is a second root element; XML has one");
  }
}

void XmlFile::expectRoot(const std::string& name) const {
  if (root().name() == name) return;
  throw std::runtime_error(place(root()) + ": the root element is <" + root().name() + ">, not <" + name + ">");
}

void XmlFile::refuseXacro(const std::string& result) const {
  const pugi::xml_node element =
      root().find_node([](const pugi::xml_node& node) { return std::string(node.name()).rfind("xacro:", 0) == 0; });
  if (!element) return;
  throw std::runtime_error(place(element) + ": <" + element.name() + "> is a xacro element; run `xacro FILE > " +
                           result + "` first");
}

std::string XmlFile::placeOf(std::ptrdiff_t offset) const {
  if (!has_lines_) return file_;
  const std::size_t end = std::min(static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0)), text_.size());
  const auto lines = std::count(text_.begin(), text_.begin() + static_cast<std::ptrdiff_t>(end), '\n');
  return file_ + ": line " + std::to_string(lines + 1);
}

std::string XmlFile::place(const pugi::xml_node& element) const { return placeOf(element.offset_debug()); }

std::string XmlFile::attribute(const pugi::xml_node& element, const char* name) const {
  const pugi::xml_attribute found = element.attribute(name);
  if (!found || *found.value() == '\0') {
    throw std::runtime_error(place(element) + ": <" + element.name() + "> without " + name + "=\"...\"");
  }
  return found.value();
}

}  // namespace bocst::program
