// SPDX-License-Identifier: BSD-3-Clause
#include "io/check_scene.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <pugixml.hpp>
#include <stdexcept>
#include <string>

#include "io/binary.h"
#include "io/text.h"

namespace bocst::io {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kGlbHead = 20;  // "glTF", version, length of the file; length and kind of the JSON
constexpr int kDeepestJson = 256;     // assimp's parser recurses

/// Beginnings of the names of extensions that leave the geometry alone; Draco has its own check.
constexpr std::string_view kHarmless[] = {"KHR_materials_", "KHR_texture_",   "EXT_texture_",
                                          "MSFT_texture_",  "KHR_lights_",    "EXT_lights_",
                                          "KHR_xmp",        "KHR_techniques", "KHR_draco_mesh_compression"};
/// These change the geometry also where a file does not require them.
constexpr std::string_view kMisread[] = {"KHR_mesh_quantization", "EXT_mesh_gpu_instancing"};

bool isGlb(std::string_view bytes) { return bytes.substr(0, 4) == "glTF"; }

Json parseGltf(std::string_view bytes) {
  std::string_view text = bytes;
  if (isGlb(bytes)) {
    if (bytes.size() < kGlbHead) throw std::runtime_error("truncated: no GLB header of 20 bytes");
    const std::size_t size = number<std::uint32_t>(bytes.substr(12), false);
    if (size > bytes.size() - kGlbHead) throw std::runtime_error("truncated: the file ends in the JSON of the GLB");
    text = bytes.substr(kGlbHead, size);
  }
  text = text.substr(0, text.find('\0'));  // some pad the JSON with zeros
  const auto check_depth = [](int depth, Json::parse_event_t, const Json&) {
    if (depth > kDeepestJson) throw std::runtime_error("JSON nested deeper than " + std::to_string(kDeepestJson));
    return true;
  };
  try {
    return Json::parse(text.begin(), text.end(), check_depth);
  } catch (const Json::parse_error& e) {
    // Not its message, which may have a whole buffer in it.
    const std::size_t at = std::min(std::max(e.byte, std::size_t{1}) - 1, text.size());
    failAt(text, text.data() + at, "no glTF file: malformed JSON");
  } catch (const Json::exception&) {
    throw std::runtime_error("no glTF file: JSON with a number that is too large");
  }
}

/// assimp decodes Draco, but not indices of 32 bits: it leaves these as they are in the file.
void refuseWideDraco(const Json& file) {
  static const Json::json_pointer draco("/extensions/KHR_draco_mesh_compression");
  for (const Json& mesh : file.value("meshes", Json::array())) {
    if (!mesh.is_object()) continue;
    for (const Json& primitive : mesh.value("primitives", Json::array())) {
      const auto indices = primitive.find("indices");
      if (!primitive.contains(draco) || indices == primitive.end() || !indices->is_number_unsigned()) continue;
      const Json::json_pointer type("/accessors/" + indices->dump() + "/componentType");
      if (!file.contains(type) || file[type] != 5125) continue;
      throw std::runtime_error("Draco with indices of 32 bits is not supported: export without compression");
    }
  }
}

void refuseGltf(std::string_view bytes) {
  const Json file = parseGltf(bytes);
  if (!file.is_object()) throw std::runtime_error("no glTF file: its JSON is no object");
  const auto refuseNames = [&file](const char* list, const auto& is_refused) {
    for (const Json& entry : file.value(list, Json::array())) {
      if (!entry.is_string()) continue;
      const auto& name = entry.get_ref<const std::string&>();
      if (!is_refused(name)) continue;
      throw std::runtime_error("the glTF extension " + inQuotes(name) +
                               " is not supported: export without it (no compression, quantization or instances)");
    }
  };
  refuseNames("extensionsUsed", [](const std::string& name) {
    return std::find(std::begin(kMisread), std::end(kMisread), name) != std::end(kMisread);
  });
  refuseNames("extensionsRequired", [](const std::string& name) {
    return std::none_of(std::begin(kHarmless), std::end(kHarmless),
                        [&](std::string_view beginning) { return name.compare(0, beginning.size(), beginning) == 0; });
  });
  refuseWideDraco(file);
  const Json skins = file.value("skins", Json::array());
  if (!skins.is_array()) return;  // glTF 1.0, whose skins assimp skips
  for (const Json& skin : skins) {
    const auto matrices = skin.find("inverseBindMatrices");
    if (matrices != skin.end() && matrices->is_number_unsigned()) continue;
    throw std::runtime_error("a skin without inverseBindMatrices is not supported: export without skins (armatures)");
  }
}

void refuseAmf(std::string_view bytes) {
  if (bytes.find("<constellation") == std::string_view::npos) return;
  pugi::xml_document document;
  if (!document.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8)) return;
  if (!document.child("amf").child("constellation")) return;
  throw std::runtime_error("AMF with a <constellation> is not supported: export as 3MF");
}

}  // namespace

void refuseMisread(std::string_view bytes, std::string_view ending) {
  if (isGlb(bytes) || ending == "gltf" || ending == "glb" || ending == "vrm") {
    refuseGltf(bytes);
  } else {
    refuseAmf(bytes);
  }
}

}  // namespace bocst::io
