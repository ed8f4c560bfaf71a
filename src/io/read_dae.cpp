// SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <pugixml.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "io/read_mesh.h"
#include "io/text.h"

namespace bocst::io {
namespace {

// A few lines of XML that instantiate each other could ask for any amount of geometry.
constexpr std::size_t kMostElements = std::size_t{1} << 21;  // of nodes, each time that they are instantiated
constexpr std::size_t kMostCorners = std::size_t{1} << 26;   // and vertices
constexpr int kDeepest = 256;

/// COLLADA's geometry: the triangles, polygons, fans and strips that the visual scene instantiates.
class DaeReader {
 public:
  explicit DaeReader(std::string_view bytes) : bytes_(bytes) {}

  Polygons read() {
    parse();
    const pugi::xml_node root = document_.child("COLLADA");
    if (!root) throw std::runtime_error("no COLLADA file: the root element is not COLLADA");
    const double meter = unit(root);
    collectIds(root);
    const pugi::xml_node instance = root.child("scene").child("instance_visual_scene");
    if (!instance) throw std::runtime_error("no <scene> with an <instance_visual_scene>: nothing says what is where");
    const pugi::xml_node scene = target(instance, "url", {"visual_scene"});
    const Eigen::Affine3d X_SP(Eigen::Scaling(meter));
    for (const pugi::xml_node node : scene.children("node")) place(node, X_SP, 1);
    return std::move(polygons_);
  }

 private:
  [[noreturn]] void fail(const pugi::xml_node& node, const std::string& what) const {
    failAtOffset(node.offset_debug(), std::string("<") + node.name() + ">: " + what);
  }

  [[noreturn]] void failAtOffset(std::ptrdiff_t offset, const std::string& what) const {
    if (!has_lines_) throw std::runtime_error(what);
    failAt(bytes_, bytes_.data() + std::clamp<std::ptrdiff_t>(offset, 0, static_cast<std::ptrdiff_t>(bytes_.size())),
           what);
  }

  void parse() {
    // Fragments: what stands outside the root element is kept, to be refused.
    const pugi::xml_parse_result result =
        document_.load_buffer(bytes_.data(), bytes_.size(), pugi::parse_default | pugi::parse_fragment);
    has_lines_ = result.encoding == pugi::encoding_utf8;
    if (!result) failAtOffset(result.offset, std::string("no XML: ") + result.description());
    if (result.encoding == pugi::encoding_utf8 && bytes_.find('\0') != std::string_view::npos) {
      failAt(bytes_, bytes_.data() + bytes_.find('\0'), "no XML: a zero byte");
    }
    const auto elements = document_.children();
    if (std::distance(elements.begin(), elements.end()) != 1) {
      throw std::runtime_error("no COLLADA file: one root element expected and nothing beside it");
    }
  }

  double unit(const pugi::xml_node& root) const {
    const pugi::xml_node unit = root.child("asset").child("unit");
    const pugi::xml_attribute meter = unit.attribute("meter");
    double size = 1;
    if (meter && !(toNumber(meter.value(), size) && size > 0 && std::isfinite(size))) {
      fail(unit, "meter=" + inQuotes(meter.value()) + " is no positive number");
    }
    return size;
  }

  void collectIds(const pugi::xml_node& root) {
    // Without recursion: elements may nest as deep as they like.
    for (pugi::xml_node node = root.first_child(); node && node != root;) {
      const std::string_view name = node.name();
      if (name == "geometry" || name == "node" || name == "visual_scene" || name == "controller") {
        const std::string_view id = node.attribute("id").value();
        if (!id.empty() && !ids_.emplace(id, node).second) fail(node, "twice the id " + inQuotes(id));
      }
      if (node.first_child()) {
        node = node.first_child();
        continue;
      }
      while (node != root && !node.next_sibling()) node = node.parent();
      if (node != root) node = node.next_sibling();
    }
  }

  /// What the attribute of `node`, "#id", refers to, if it is one of these elements.
  pugi::xml_node target(const pugi::xml_node& node, const char* attribute,
                        std::initializer_list<std::string_view> names) const {
    const std::string_view url = node.attribute(attribute).value();
    if (url.empty() || url[0] != '#') fail(node, inQuotes(url) + " is no place in this file");
    const auto found = ids_.find(url.substr(1));
    if (found == ids_.end()) fail(node, "there is no " + inQuotes(url));
    if (std::find(names.begin(), names.end(), found->second.name()) == names.end()) {
      fail(node, inQuotes(url) + " is a <" + found->second.name() + ">");
    }
    return found->second;
  }

  /// All numbers in an element's text.
  template <typename Number>
  std::vector<Number> numbers(const pugi::xml_node& node) const {
    std::vector<Number> result;
    for (const pugi::xml_node& part : node.children()) {  // comments divide the text into parts
      if (part.type() == pugi::node_element) fail(node, std::string("numbers expected, not <") + part.name() + ">");
      const std::string_view text = part.value();
      std::string_view rest = text;
      for (std::string_view word = takeWord(rest); !word.empty(); word = takeWord(rest)) {
        Number number = 0;
        if (toNumber(word, number) && std::isfinite(static_cast<double>(number))) {
          result.push_back(number);
          continue;
        }
        const std::string what =
            inQuotes(word) + (std::is_same_v<Number, double> ? " is no finite number" : " is no index");
        const std::ptrdiff_t at = part.offset_debug();
        if (!has_lines_ || at < 0 || static_cast<std::size_t>(at) > bytes_.size()) fail(node, what);
        // Ends of lines are one byte each in the text, so lines are counted there and not in the file.
        const auto lines =
            std::count(bytes_.data(), bytes_.data() + at, '\n') + std::count(text.data(), word.data(), '\n');
        throw std::runtime_error("line " + std::to_string(lines + 1) + ": <" + node.name() + ">: " + what);
      }
    }
    return result;
  }

  std::size_t count(const pugi::xml_node& node, const char* attribute, std::size_t missing) const {
    const pugi::xml_attribute given = node.attribute(attribute);
    long long number = 0;
    if (!given) return missing;
    if (!toNumber(given.value(), number) || number < 0) {
      fail(node, std::string(attribute) + "=" + inQuotes(given.value()) + " is no count");
    }
    return static_cast<std::size_t>(number);
  }

  // Nodes

  void place(const pugi::xml_node& node, const Eigen::Affine3d& X_SP, int depth) {
    if (depth > kDeepest) fail(node, "nodes nest too deep, or instantiate themselves");
    Eigen::Affine3d X_SN = X_SP;
    for (const pugi::xml_node& child : node.children()) {
      if (++elements_ > kMostElements) fail(node, "nodes instantiate each other millions of times");
      if (child.type() == pugi::node_element) X_SN = X_SN * transform(child);
    }
    for (const pugi::xml_node& child : node.children()) {
      const std::string_view name = child.name();
      if (name == "node") place(child, X_SN, depth + 1);
      if (name == "instance_node") place(target(child, "url", {"node"}), X_SN, depth + 1);
      if (name == "instance_geometry") add(target(child, "url", {"geometry"}), X_SN);
      if (name == "instance_controller") add(skinned(child), X_SN);
    }
  }

  /// The geometry that a controller deforms, as it is before. A skin's bind_shape_matrix belongs to its bones, as in
  /// assimp and what loads meshes by it.
  pugi::xml_node skinned(const pugi::xml_node& instance) const {
    pugi::xml_node node = target(instance, "url", {"controller"});
    for (int depth = 0; std::string_view(node.name()) == "controller"; ++depth) {
      pugi::xml_node deformer = node.child("skin");
      if (!deformer) deformer = node.child("morph");
      if (!deformer || depth == kDeepest) fail(node, "no geometry under this controller");
      node = target(deformer, "source", {"geometry", "controller"});
    }
    return node;
  }

  /// Identity for elements that are no transform.
  Eigen::Affine3d transform(const pugi::xml_node& node) const {
    const std::string_view name = node.name();
    Eigen::Affine3d X = Eigen::Affine3d::Identity();
    const auto values = [&](std::size_t n) {
      std::vector<double> v = numbers<double>(node);
      if (v.size() != n) fail(node, std::to_string(n) + " numbers expected, there are " + std::to_string(v.size()));
      return v;
    };
    const auto vector = [](const std::vector<double>& v, std::size_t i) {
      return Eigen::Vector3d(v[i], v[i + 1], v[i + 2]);
    };
    if (name == "matrix") {
      const std::vector<double> v = values(16);
      for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 4; ++column)
          X.matrix()(row, column) = v[static_cast<std::size_t>(4 * row + column)];
      }
      if (v[12] != 0 || v[13] != 0 || v[14] != 0 || v[15] != 1) fail(node, "the last row is not 0 0 0 1");
    } else if (name == "translate") {
      X.translation() = vector(values(3), 0);
    } else if (name == "scale") {
      X.linear() = vector(values(3), 0).asDiagonal();
    } else if (name == "rotate") {
      const std::vector<double> v = values(4);
      X.linear() = rotation(vector(v, 0), v[3], node);
    } else if (name == "lookat") {
      // Where the node is, what it looks at along -z, and what is up: y.
      const std::vector<double> v = values(9);
      const Eigen::Vector3d z = (vector(v, 0) - vector(v, 3)).normalized();
      const Eigen::Vector3d x = vector(v, 6).cross(z).normalized();
      if (!(x.norm() > 0.5)) fail(node, "looks nowhere");
      X.linear() << x, z.cross(x), z;
      X.translation() = vector(v, 0);
    } else if (name == "skew") {
      X.linear() = skew(values(7), node);
    }
    return X;
  }

  /// Exact for quarter turns, which are by far the most.
  Eigen::Matrix3d rotation(const Eigen::Vector3d& axis, double degrees, const pugi::xml_node& node) const {
    if (degrees == 0) return Eigen::Matrix3d::Identity();
    const double length = axis.stableNorm();
    if (!(length > 0)) fail(node, "a rotation about no axis");
    const double turned = std::remainder(degrees, 360);
    const double quarters = turned / 90;
    double sine = std::sin(turned * (M_PI / 180));
    double cosine = std::cos(turned * (M_PI / 180));
    if (quarters == std::floor(quarters)) {
      sine = std::round(sine);
      cosine = std::round(cosine);
    }
    const Eigen::Vector3d a = axis / length;
    Eigen::Matrix3d cross;
    cross << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
    return cosine * Eigen::Matrix3d::Identity() + sine * cross + (1 - cosine) * a * a.transpose();
  }

  /// RenderMan's: turns `turned` by the angle towards `towards`, and shears space along.
  Eigen::Matrix3d skew(const std::vector<double>& v, const pugi::xml_node& node) const {
    const Eigen::Vector3d turned = Eigen::Vector3d(v[1], v[2], v[3]).normalized();
    const Eigen::Vector3d towards = Eigen::Vector3d(v[4], v[5], v[6]).normalized();
    const double along = turned.dot(towards);
    const Eigen::Vector3d across = turned - along * towards;
    const double height = across.norm();
    if (!(height > 1e-12)) fail(node, "a skew along its own axis");
    const double angle = std::atan2(height, along) - v[0] * (M_PI / 180);  // what is left between the two
    if (!(std::sin(angle) > 1e-12)) fail(node, "a skew of this angle has no end");
    const double shift = height * std::cos(angle) / std::sin(angle) - along;
    return Eigen::Matrix3d::Identity() + shift / height * towards * (across / height).transpose();
  }

  // Geometry

  /// Adds the geometry's polygons where X puts them.
  void add(const pugi::xml_node& geometry, const Eigen::Affine3d& X_SG) {
    const auto known = geometries_.find(geometry.internal_object());
    const Polygons& local = known != geometries_.end()
                                ? known->second
                                : geometries_.emplace(geometry.internal_object(), readGeometry(geometry)).first->second;
    if (local.ends.empty()) return;  // lines only
    if (polygons_.corners.size() + local.corners.size() > kMostCorners ||
        polygons_.vertices.size() + local.vertices.size() > kMostCorners) {
      fail(geometry, "more than " + std::to_string(kMostCorners) + " corners with all instances");
    }
    const auto base = static_cast<std::uint32_t>(polygons_.vertices.size());
    const std::size_t corners = polygons_.corners.size();
    const bool identity = X_SG.matrix().isIdentity(0);
    for (const Eigen::Vector3d& p : local.vertices) polygons_.vertices.push_back(identity ? p : X_SG * p);
    for (const std::uint32_t c : local.corners) polygons_.corners.push_back(base + c);
    for (const std::size_t end : local.ends) polygons_.ends.push_back(corners + end);
  }

  Polygons readGeometry(const pugi::xml_node& geometry) const {
    for (const char* other : {"convex_mesh", "brep"}) {
      if (geometry.child(other)) fail(geometry.child(other), "not supported, only <mesh>");
    }
    Polygons polygons;
    const pugi::xml_node mesh = geometry.child("mesh");
    const pugi::xml_node vertices = mesh.child("vertices");  // a mesh has one; looked for once, there may be many faces
    bool has_read = false;
    for (const pugi::xml_node& primitive : mesh.children()) {
      const std::string_view name = primitive.name();
      if (name == "triangles" || name == "polylist" || name == "polygons" || name == "trifans" || name == "tristrips") {
        if (!std::exchange(has_read, true)) polygons.vertices = readVertices(mesh, vertices);
        readPrimitive(primitive, vertices, polygons);
      }
    }
    return polygons;
  }

  pugi::xml_node sourceOf(const pugi::xml_node& input, const pugi::xml_node& mesh) const {
    const std::string_view url = input.attribute("source").value();
    for (const pugi::xml_node& node : mesh.children("source")) {
      if (!url.empty() && url[0] == '#' && url.substr(1) == node.attribute("id").value()) return node;
    }
    fail(input, "its mesh has no <source> " + inQuotes(url));
  }

  std::vector<Eigen::Vector3d> readVertices(const pugi::xml_node& mesh, const pugi::xml_node& vertices) const {
    const pugi::xml_node input = vertices.find_child_by_attribute("input", "semantic", "POSITION");
    if (!input) fail(mesh, "no <vertices> with an <input> for POSITION");
    const pugi::xml_node source = sourceOf(input, mesh);
    const pugi::xml_node accessor = source.child("technique_common").child("accessor");
    if (!accessor) fail(source, "no <accessor>");
    const pugi::xml_node array = source.child("float_array");
    if (!array || accessor.attribute("source").value() != "#" + std::string(array.attribute("id").value())) {
      fail(accessor, "no <float_array> of this name beside it");
    }
    const std::vector<double> values = numbers<double>(array);
    if (values.size() != count(array, "count", values.size())) {
      fail(array, "there are " + std::to_string(values.size()) + " numbers, not " + array.attribute("count").value());
    }

    // Parameters without a name are skipped; without any name the first three are meant.
    std::array<std::size_t, 3> place{0, 1, 2};
    std::size_t params = 0;
    unsigned named = 0;
    for (const pugi::xml_node& param : accessor.children("param")) {
      const std::string_view name = param.attribute("name").value();
      const std::size_t axis = std::string_view("XYZ").find(name);
      if (name.size() == 1 && axis < 3) {
        place[axis] = params;
        named |= 1u << axis;
      }
      ++params;
    }
    if (named != 0 && named != 7) fail(accessor, "parameters X, Y and Z expected");
    const std::size_t stride = count(accessor, "stride", 1);
    const std::size_t offset = count(accessor, "offset", 0);
    const std::size_t n = count(accessor, "count", 0);
    const std::size_t last = *std::max_element(place.begin(), place.end());
    if (last >= stride) fail(accessor, "stride=" + std::to_string(stride) + " is less than three coordinates");
    const std::size_t room = values.size() > offset ? values.size() - offset : 0;
    if (n > 0 && (room <= last || n - 1 > (room - 1 - last) / stride)) {
      fail(accessor, std::to_string(n) + " vertices do not fit into " + std::to_string(values.size()) + " numbers");
    }
    std::vector<Eigen::Vector3d> result;
    result.reserve(n);
    for (std::size_t i = 0; i < n; ++i) {
      const double* v = values.data() + offset + i * stride;
      result.emplace_back(v[place[0]], v[place[1]], v[place[2]]);
    }
    return result;
  }

  // The vertex indices of a <p>: of each `stride` numbers, that at `offset`.
  std::vector<std::uint32_t> corners(const pugi::xml_node& p, std::size_t stride, std::size_t offset,
                                     std::size_t vertices) const {
    const std::vector<long long> all = numbers<long long>(p);
    if (all.size() % stride != 0) {
      fail(p, std::to_string(all.size()) + " indices are no multiple of " + std::to_string(stride) + " a corner");
    }
    std::vector<std::uint32_t> result;
    result.reserve(all.size() / stride);
    for (std::size_t i = offset; i < all.size(); i += stride) {
      if (all[i] < 0 || static_cast<std::size_t>(all[i]) >= vertices) {
        fail(p, "vertex index " + std::to_string(all[i]) + " out of range, there are " + std::to_string(vertices) +
                    " vertices");
      }
      result.push_back(static_cast<std::uint32_t>(all[i]));
    }
    return result;
  }

  // Adds the polygons of a <triangles> or <polylist>, whose corners are in one list. Returns how many there are.
  std::size_t addCounted(const pugi::xml_node& primitive, const std::vector<std::uint32_t>& all,
                         Polygons& polygons) const {
    const bool is_polylist = std::string_view(primitive.name()) == "polylist";
    std::vector<long long> sizes(is_polylist ? 0 : all.size() / 3, 3);
    if (is_polylist) sizes = numbers<long long>(primitive.child("vcount"));
    std::size_t end = 0;
    for (const long long size : sizes) {
      if (size < 0 || static_cast<std::size_t>(size) > all.size() - end) fail(primitive, "more corners than indices");
      for (long long k = 0; k < size; ++k) polygons.corners.push_back(all[end++]);
      polygons.ends.push_back(polygons.corners.size());
    }
    if (end != all.size()) fail(primitive, "more indices than corners");
    return sizes.size();
  }

  void readPrimitive(const pugi::xml_node& primitive, const pugi::xml_node& vertices, Polygons& polygons) const {
    const pugi::xml_node vertex = primitive.find_child_by_attribute("input", "semantic", "VERTEX");
    const std::size_t promised = count(primitive, "count", 0);
    if (!vertex) {
      if (promised == 0 && !primitive.child("p")) return;
      fail(primitive, "no <input> for VERTEX");
    }
    if (vertex.attribute("source").value() != "#" + std::string(vertices.attribute("id").value())) {
      fail(vertex, "its mesh has no <vertices> " + inQuotes(vertex.attribute("source").value()));
    }
    std::size_t stride = 1;
    for (const pugi::xml_node& input : primitive.children("input")) {
      stride = std::max(stride, count(input, "offset", 0) + 1);
    }
    const std::size_t offset = count(vertex, "offset", 0);
    const auto cornersOf = [&](const pugi::xml_node& p) {
      return corners(p, stride, offset, polygons.vertices.size());
    };

    if (primitive.child("ph")) fail(primitive.child("ph"), "polygons with holes are not supported");
    const std::string_view name = primitive.name();
    std::size_t found = 0;
    if (name == "triangles" || name == "polylist") {
      found = addCounted(primitive, cornersOf(primitive.child("p")), polygons);
    } else {
      for (const pugi::xml_node& p : primitive.children("p")) {
        const std::vector<std::uint32_t> c = cornersOf(p);
        if (name == "tristrips") polygons.addStrip(c.data(), c.size());
        if (name == "trifans") {
          for (std::size_t i = 2; i < c.size(); ++i) polygons.addTriangle(c[0], c[i - 1], c[i]);
        }
        if (name == "polygons") {
          polygons.corners.insert(polygons.corners.end(), c.begin(), c.end());
          polygons.ends.push_back(polygons.corners.size());
        }
        ++found;
      }
    }
    if (found != promised) {
      fail(primitive, "there are " + std::to_string(found) + " of them, not " + std::to_string(promised));
    }
  }

  std::string_view bytes_;
  bool has_lines_ = true;  // the bytes are UTF-8, so offsets in the XML are those of the bytes
  pugi::xml_document document_;
  std::unordered_map<std::string_view, pugi::xml_node> ids_;
  std::unordered_map<void*, Polygons> geometries_;
  std::size_t elements_ = 0;
  Polygons polygons_;
};

}  // namespace

Polygons readDae(std::string_view bytes) { return DaeReader(bytes).read(); }

}  // namespace bocst::io
