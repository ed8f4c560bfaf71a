// SPDX-License-Identifier: BSD-3-Clause
#include "robot/packages.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <stdexcept>
#include <system_error>

namespace bocst::program {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> foldersOf(const char* variable) {
  std::vector<fs::path> folders;
  const char* value = std::getenv(variable);
  std::istringstream list(value == nullptr ? "" : value);
  for (std::string folder; std::getline(list, folder, ':');) {
    if (!folder.empty()) folders.emplace_back(folder);
  }
  return folders;
}

bool isFolder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

/// The folder itself, or the one of this name in it.
fs::path namedFolder(const fs::path& folder, const std::string& name) {
  if (isFolder(folder / name)) return folder / name;
  return folder.filename() == name && isFolder(folder) ? folder : fs::path();
}

bool startsWith(const std::string& text, const std::string& start) { return text.rfind(start, 0) == 0; }

}  // namespace

Packages::Packages(const std::vector<std::string>& given) {
  for (const std::string& text : given) {
    const std::size_t at = text.find('=');
    if (at == 0 || at == std::string::npos || at + 1 == text.size()) {
      throw std::invalid_argument(text + ": name=folder expected");
    }
    folders_[text.substr(0, at)] = text.substr(at + 1);
  }
}

std::string Packages::find(const std::string& name, const std::string& folder) const {
  const auto given = folders_.find(name);
  if (given != folders_.end()) return given->second;
  for (const fs::path& path : foldersOf("ROS_PACKAGE_PATH")) {
    const fs::path found = namedFolder(path.has_filename() ? path : path.parent_path(), name);
    if (!found.empty()) return found.string();
  }
  for (const fs::path& prefix : foldersOf("AMENT_PREFIX_PATH")) {
    if (isFolder(prefix / "share" / name)) return (prefix / "share" / name).string();
  }
  std::error_code error;
  for (fs::path at = fs::absolute(folder.empty() ? "." : folder, error); !error; at = at.parent_path()) {
    const fs::path found = namedFolder(at.has_filename() ? at : at.parent_path(), name);
    if (!found.empty()) return found.string();
    if (at == at.parent_path()) break;
  }
  throw std::runtime_error("package " + name + " is not found in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or above " +
                           (folder.empty() ? "." : folder) + "; give --package " + name + "=FOLDER");
}

std::string Packages::resolve(const std::string& uri, const std::string& folder) const {
  for (const std::string scheme : {"package://", "model://"}) {
    if (!startsWith(uri, scheme)) continue;
    const std::size_t end = std::min(uri.find('/', scheme.size()), uri.size());
    const std::string name = uri.substr(scheme.size(), end - scheme.size());
    if (name.empty() || end + 1 >= uri.size()) throw std::runtime_error(scheme + "NAME/FILE expected");
    return (fs::path(find(name, folder)) / uri.substr(end + 1)).string();
  }
  if (startsWith(uri, "file://")) return uri.substr(7);
  if (uri.find("://") != std::string::npos) {
    throw std::runtime_error("unknown kind of URI: use package://, model://, file:// or a path");
  }
  return (fs::path(folder) / uri).string();  // an absolute path stays as it is
}

}  // namespace bocst::program
