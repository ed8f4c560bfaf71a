// SPDX-License-Identifier: BSD-3-Clause
#include "mesh/spheres.h"

#include <cstdio>
#include <stdexcept>

#include "cli/report.h"
#include "cli/words.h"

namespace bocst::program {
namespace {

enum class Format { kJson, kPly, kYaml };

Format formatOf(const std::string& file) {
  const std::string ending = endingOf(file);
  if (ending == ".json") return Format::kJson;
  if (ending == ".ply") return Format::kPly;
  if (ending == ".yaml" || ending == ".yml") return Format::kYaml;
  throw std::invalid_argument(file + ": not a .ply, .json, .yaml or .yml file");
}

/// All digits, so that a sphere still holds what it held. YAML readers take 1e-05 for text, so a point is put in.
std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.17g", value);
  std::string result = text;
  const std::size_t exponent = result.find('e');
  if (exponent != std::string::npos && result.find('.') == std::string::npos) result.insert(exponent, ".0");
  return result;
}

/// Each sphere as before + x, y, z with commas or spaces between + middle + radius + after.
std::string list(const std::vector<Sphere>& spheres, const char* before, const char* comma, const char* middle,
                 const char* after) {
  std::string text;
  for (const Sphere& sphere : spheres) {
    text += before + number(sphere.center.x()) + comma + number(sphere.center.y()) + comma + number(sphere.center.z()) +
            middle + number(sphere.radius) + after;
  }
  return text;
}

}  // namespace

std::vector<Sphere> spheresOf(const std::vector<NodeView>& nodes) {
  std::vector<Sphere> spheres;
  spheres.reserve(nodes.size());
  for (const NodeView& node : nodes) spheres.push_back({node.center, node.radius});
  return spheres;
}

void checkSphereFile(const std::string& file) { formatOf(file); }

std::string sphereFile(const std::string& file, const std::vector<Sphere>& spheres, const std::string& link) {
  switch (formatOf(file)) {
    case Format::kPly:
      return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(spheres.size()) +
             "\nproperty double x\nproperty double y\nproperty double z\nproperty double radius\nend_header\n" +
             list(spheres, "", " ", " ", "\n");
    case Format::kYaml:
      return "collision_spheres:\n  " + Json(link).dump(-1, ' ', true, Json::error_handler_t::replace) + ":\n" +
             list(spheres, "    - \"center\": [", ", ", "]\n      \"radius\": ", "\n");
    case Format::kJson:
      break;
  }
  std::string text = list(spheres, "  {\"center\": [", ", ", "], \"radius\": ", "},\n");
  text.resize(text.size() - 2);  // the last comma; there is one sphere at least
  return "[\n" + text + "\n]\n";
}

}  // namespace bocst::program
