// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <pugixml.hpp>
#include <string>

namespace bocst::program {

/// An XML file that knows the lines of its elements.
class XmlFile {
 public:
  /// @throws std::runtime_error that names the line when it cannot be read, is no XML, or has a second root element.
  explicit XmlFile(std::string file);
  /// The same of a file that has been read.
  XmlFile(std::string file, std::string text);

  /// @throws std::runtime_error that names the line if its root has another name.
  void expectRoot(const std::string& name) const;

  const std::string& name() const { return file_; }
  const std::string& text() const { return text_; }
  pugi::xml_node root() const { return document_.document_element(); }

  /// @throws std::runtime_error if there is an element of xacro. `result`: a name for what xacro writes.
  void refuseXacro(const std::string& result) const;

  /// "FILE: line N", for complaints about this element; "FILE" where the characters are not those of ASCII or UTF-8.
  std::string place(const pugi::xml_node& element) const;

  /// An attribute that must be there. @throws std::runtime_error that names the line.
  std::string attribute(const pugi::xml_node& element, const char* name) const;

 private:
  std::string placeOf(std::ptrdiff_t offset) const;

  std::string file_;
  std::string text_;
  bool has_lines_ = true;  // offsets are those of the text
  pugi::xml_document document_;
};

}  // namespace bocst::program
