// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace bocst::program {

/// Where ROS packages are.
class Packages {
 public:
  /// @param given "name=folder" each. @throws std::invalid_argument for one that is not, no folder, or a name
  /// that was given before.
  explicit Packages(const std::vector<std::string>& given = {});

  /// A package that the command line does not name.
  void add(const std::string& name, const std::string& folder) { folders_.emplace(name, folder); }

  /// The file that a URI means in a file of this folder: package://name/path or model://name/path, file:///path (%20 is
  /// a blank there), /path, path. Packages are looked for among those given, in and below the folders of
  /// ROS_PACKAGE_PATH, in AMENT_PREFIX_PATH, and from `folder` upwards. A package has the name that its package.xml
  /// says; a folder of this name without a package.xml will do, too.
  /// @throws std::runtime_error that says where the package was looked for.
  std::string resolve(const std::string& uri, const std::string& folder) const;

 private:
  std::string find(const std::string& name, const std::string& folder) const;
  std::string search(const std::string& name, const std::string& folder) const;

  std::map<std::string, std::string> folders_;
  mutable std::map<std::pair<std::string, std::string>, std::string> found_;  // by name and folder
};

}  // namespace bocst::program
