// SPDX-License-Identifier: BSD-3-Clause
#include "robot/packages.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <pugixml.hpp>
#include <set>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "io/text.h"

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

bool isThere(const fs::path& path) {
  std::error_code error;
  return fs::exists(path, error);
}

/// The name of the package in this folder; empty: none. rosbuild's manifest.xml has no name.
std::string packageIn(const fs::path& folder) {
  pugi::xml_document manifest;
  if (manifest.load_file((folder / "package.xml").c_str())) {
    std::istringstream words(manifest.child("package").child_value("name"));
    std::string name;
    words >> name;
    return name;
  }
  return isThere(folder / "manifest.xml") ? folder.filename().string() : "";
}

/// The package of this name in a folder or below, as rospack looks for it: not inside of other packages.
fs::path crawl(const fs::path& folder, const std::string& name, std::set<fs::path>& seen) {
  std::error_code error;
  const fs::path place = fs::canonical(folder, error);  // links may lead round in a circle
  if (error || !isFolder(place) || !seen.insert(place).second) return {};
  const std::string package = packageIn(folder);
  if (!package.empty()) return package == name ? folder : fs::path();
  for (const char* mark : {"rospack_nosubdirs", "CATKIN_IGNORE", "AMENT_IGNORE", "COLCON_IGNORE"}) {
    if (isThere(folder / mark)) return {};
  }
  std::set<fs::path> below;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (at->path().filename().string().front() != '.') below.insert(at->path());
  }
  for (const fs::path& path : below) {
    const fs::path found = crawl(path, name, seen);
    if (!found.empty()) return found;
  }
  return {};
}
fs::path crawl(const fs::path& folder, const std::string& name) {
  std::set<fs::path> seen;
  return crawl(folder.has_filename() ? folder : folder.parent_path(), name, seen);
}

/// The folder itself, or the one of this name in it, if it is not another package.
fs::path namedFolder(const fs::path& folder, const std::string& name) {
  for (const fs::path& path : {folder / name, folder}) {
    if (path.filename() == name && isFolder(path) && packageIn(path).empty()) return path;
  }
  return {};
}

bool startsWith(const std::string& text, const std::string& start) { return text.rfind(start, 0) == 0; }

}  // namespace

Packages::Packages(const std::vector<std::string>& given) {
  for (const std::string& text : given) {
    const std::size_t at = text.find('=');
    if (at == 0 || at == std::string::npos || at + 1 == text.size()) {
      throw std::invalid_argument(text + ": name=folder expected");
    }
    if (!isFolder(text.substr(at + 1))) throw std::invalid_argument(text + ": no such folder");
    if (!folders_.emplace(text.substr(0, at), text.substr(at + 1)).second) {
      throw std::invalid_argument(text + ": the package is given twice");
    }
  }
}

std::string Packages::find(const std::string& name, const std::string& folder) const {
  const auto given = folders_.find(name);
  if (given != folders_.end()) return given->second;
  std::string& found = found_[{name, folder}];
  if (found.empty()) found = search(name, folder);
  return found;
}

std::string Packages::search(const std::string& name, const std::string& folder) const {
  const std::vector<fs::path> ros = foldersOf("ROS_PACKAGE_PATH");
  for (const fs::path& path : ros) {
    const fs::path found = crawl(path, name);
    if (!found.empty()) return found.string();
  }
  for (const fs::path& path : ros) {
    const fs::path found = namedFolder(path.has_filename() ? path : path.parent_path(), name);
    if (!found.empty()) return found.string();
  }
  for (const fs::path& prefix : foldersOf("AMENT_PREFIX_PATH")) {
    if (isFolder(prefix / "share" / name)) return (prefix / "share" / name).string();
  }
  std::error_code error;
  for (fs::path at = fs::absolute(folder.empty() ? "." : folder, error); !error; at = at.parent_path()) {
    if (packageIn(at) == name) return at.string();
    fs::path found = crawl(at / name, name);
    if (found.empty()) found = namedFolder(at.has_filename() ? at : at.parent_path(), name);
    if (!found.empty()) return found.string();
    if (at == at.parent_path()) break;
  }
  throw std::runtime_error("package " + name + " is not found in ROS_PACKAGE_PATH, AMENT_PREFIX_PATH or above " +
                           (folder.empty() ? "." : folder) + "; give --package " + name + "=FOLDER");
}

std::string Packages::resolve(const std::string& uri, const std::string& folder) const {
  if (uri.empty()) throw std::runtime_error("the name is empty");
  for (const std::string scheme : {"package://", "model://"}) {
    if (!startsWith(uri, scheme)) continue;
    const std::size_t end = std::min(uri.find('/', scheme.size()), uri.size());
    const std::string name = uri.substr(scheme.size(), end - scheme.size());
    if (name.empty() || end + 1 >= uri.size()) throw std::runtime_error(scheme + "NAME/FILE expected");
    const std::string package = find(name, folder), path = uri.substr(end);  // also where there are several slashes
    // ROS decodes names; but a file may be named as it stands.
    const std::string decoded = package + io::percentDecoded(path);
    return !isThere(package + path) && isThere(decoded) ? decoded : package + path;
  }
  if (startsWith(uri, "file://")) {
    const std::size_t path = uri.find('/', 7), host = path == std::string::npos ? 0 : path - 7;
    if (path == std::string::npos || (host > 0 && uri.substr(7, host) != "localhost")) {
      throw std::runtime_error("file:// and an absolute path expected, as in file:///opt/part.stl");
    }
    return io::percentDecoded(uri.substr(path));
  }
  if (uri.find("://") != std::string::npos) {
    throw std::runtime_error("unknown kind of URI: use package://, model://, file:// or a path");
  }
  return (fs::path(folder) / uri).string();  // an absolute path stays as it is
}

}  // namespace bocst::program
