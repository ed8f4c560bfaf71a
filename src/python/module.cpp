// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/collide_poses.h>
#include <bocst/io.h>
#include <bocst/model.h>
#include <bocst/oracle.h>
#include <bocst/scene.h>
#include <pybind11/operators.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <unordered_map>
#include <utility>

#include "mesh/health.h"
#include "mesh/spheres.h"
#include "python/arrays.h"
#include "python/geometry.h"

// Functions named bind... are lists with a line or two for each name of Python, so they are as long as that list.
namespace bocst::python {
namespace {

using namespace pybind11::literals;
using MeshPtr = std::shared_ptr<Mesh>;

/// pybind11 holds what is not const; nothing here changes a mesh.
MeshPtr forPython(const std::shared_ptr<const Mesh>& mesh) { return std::const_pointer_cast<Mesh>(mesh); }

/// The rows of a C++ vector as a read-only array that keeps `owner` alive.
template <typename T, typename Row>
py::array_t<T> rows(const std::vector<Row>& of, py::ssize_t width, const py::object& owner) {
  py::array_t<T> a({static_cast<py::ssize_t>(of.size()), width}, reinterpret_cast<const T*>(of.data()), owner);
  a.attr("setflags")("write"_a = false);
  return a;
}

// Options -------------------------------------------------------------------------------------------------------------

template <typename Enum>
struct Name {
  Enum value;
  const char* name;
};
constexpr Name<Subdivision> kSubdivisions[] = {{Subdivision::kOctree, "octree"}, {Subdivision::kBono, "bono"}};
constexpr Name<Answer> kAnswers[] = {{Answer::kExact, "exact"}, {Answer::kConservative, "conservative"}};
constexpr Name<OracleKind> kOracles[] = {{OracleKind::kAuto, "auto"},
                                         {OracleKind::kCpu, "cpu"},
                                         {OracleKind::kOcclusion, "occlusion"},
                                         {OracleKind::kCompute, "compute"},
                                         {OracleKind::kSampled, "sampled"}};
constexpr Name<fcl::CCDMotionType> kMotions[] = {{fcl::CCDM_TRANS, "translation"},
                                                 {fcl::CCDM_LINEAR, "linear"},
                                                 {fcl::CCDM_SCREW, "screw"},
                                                 {fcl::CCDM_SPLINE, "spline"}};

template <typename Enum, std::size_t N>
Enum valueOf(const char* what, const std::string& text, const Name<Enum> (&names)[N]) {
  std::string all;
  for (const Name<Enum>& n : names) {
    if (text == n.name) return n.value;
    all += std::string(all.empty() ? "" : ", ") + n.name;
  }
  throw py::value_error(std::string("bocst: ") + what + " is '" + text + "'; one of " + all + " is expected");
}
template <typename Enum, std::size_t N>
std::string nameOf(Enum value, const Name<Enum> (&names)[N]) {
  return std::find_if(std::begin(names), std::end(names), [value](const Name<Enum>& n) { return n.value == value; })
      ->name;
}

std::chrono::milliseconds milliseconds(double seconds) {
  if (!(std::abs(seconds) < 1e12)) throw py::value_error("bocst: ttl is " + std::to_string(seconds) + " seconds");
  const std::chrono::milliseconds rounded(std::llround(seconds * 1e3));
  // 0 means never.
  return seconds > 0 ? std::max(rounded, std::chrono::milliseconds(1)) : rounded;
}

Options makeOptions(const std::string& subdivision, const std::string& answer, int depth, double dimension,
                    const std::string& oracle, double ttl, std::size_t memory_budget, double margin, bool solid,
                    bool build_ahead) {
  Options o;
  o.subdivision = valueOf("subdivision", subdivision, kSubdivisions);
  o.answer = valueOf("answer", answer, kAnswers);
  o.depth = depth;
  o.dimension = dimension;
  o.oracle = valueOf("oracle", oracle, kOracles);
  o.ttl = milliseconds(ttl);
  o.memory_budget = memory_budget;
  o.margin = margin;
  o.solid = solid;
  o.build_ahead = build_ahead;
  return o;
}

py::dict asDict(const Options& o) {
  return py::dict("subdivision"_a = nameOf(o.subdivision, kSubdivisions), "answer"_a = nameOf(o.answer, kAnswers),
                  "depth"_a = o.depth, "dimension"_a = o.dimension, "oracle"_a = nameOf(o.oracle, kOracles),
                  "ttl"_a = static_cast<double>(o.ttl.count()) / 1e3, "memory_budget"_a = o.memory_budget,
                  "margin"_a = o.margin, "solid"_a = o.solid, "build_ahead"_a = o.build_ahead);
}

std::string repr(const char* name, const py::dict& values) {
  std::string text;
  for (const auto& [key, value] : values) {
    text += (text.empty() ? "" : ", ") + std::string(py::str(key)) + "=" + std::string(py::repr(value));
  }
  return std::string("bocst.") + name + "(" + text + ")";
}

/// What help() says of each option.
constexpr std::pair<const char*, const char*> kOptionTexts[] = {
    {"subdivision", "'bono' (B-BOCST) or 'octree' (O-BOCST)."},
    {"answer", "'exact' (FCL's mesh-mesh answer) or 'conservative' (tests of the spheres at the collision depth)."},
    {"depth",
     "collision depth from 1 to 17, the level of the spheres that conservative answers test; the root is level 1."},
    {"dimension",
     "the paper's d_t, the mesh's largest extent in lattice units, from 1 to 65536; 0: 65536, the finest lattice."},
    {"oracle", "'auto', 'cpu', 'occlusion', 'compute' or 'sampled'."},
    {"ttl", "seconds after which unused deepest levels are dropped; 0: never."},
    {"memory_budget", "limit of the resident tree in bytes; 0: no limit."},
    {"margin", "surfaces at a distance of at most this collide; in the length unit of the mesh."},
    {"solid",
     "a watertight, consistently oriented mesh also collides with geometries that are "
     "completely inside it."},
    {"build_ahead",
     "a thread that all models share builds the tree while the first queries run, and later what else they need."}};

void bindOptions(py::module_& m) {
  std::string text = "How a model expands its tree, answers queries and drops nodes. Fixed when the model is made.\n\n";
  for (const auto& [name, meaning] : kOptionTexts) text += std::string(name) + ": " + meaning + "\n";
  py::class_<Options> options(m, "Options", text.c_str());
  options
      .def(py::init(&makeOptions), py::kw_only(), "subdivision"_a = "bono", "answer"_a = "exact", "depth"_a = 6,
           "dimension"_a = 0.0, "oracle"_a = "auto", "ttl"_a = 2.0, "memory_budget"_a = 0, "margin"_a = 0.0,
           "solid"_a = false, "build_ahead"_a = false)
      .def("__repr__", [](const Options& o) { return repr("Options", asDict(o)); })
      .def("__reduce__",
           [](const py::object& self) {
             const py::object made = py::module_::import("functools")
                                         .attr("partial")(py::type::of(self), **asDict(self.cast<const Options&>()));
             return py::make_tuple(made, py::tuple());
           })
      .def(
          "__eq__", [](const Options& a, const Options& b) { return asDict(a).equal(asDict(b)); }, py::is_operator());
  for (const auto& [name, meaning] : kOptionTexts) {
    options.def_property_readonly(
        name, [key = name](const Options& o) -> py::object { return asDict(o)[key]; }, meaning);
  }
}

// Mesh and model ------------------------------------------------------------------------------------------------------

MeshPtr makeMesh(const py::object& vertices, const py::object& triangles) {
  std::vector<Eigen::Vector3d> v = vectors("vertices", vertices);
  std::vector<Mesh::Indices> t = indices("triangles", triangles);
  const NoGil free;
  return forPython(Mesh::fromIndices(std::move(v), std::move(t)));
}

MeshPtr loadMeshOf(const py::object& file) {
  // As bytes: what is no UTF-8 in a name has no string of C++.
  const std::string name = py::module_::import("os").attr("fsencode")(file).cast<std::string>();
  try {
    const NoGil free;
    return forPython(loadMesh(name));
  } catch (const std::runtime_error& e) {
    const auto what = py::reinterpret_steal<py::object>(PyUnicode_DecodeFSDefault(e.what()));
    PyErr_SetObject(PyExc_RuntimeError, what.ptr());
    throw py::error_already_set();
  }
}

void bindMesh(py::module_& m) {
  using program::Health;
  py::class_<Health>(m, "Health",
                     "Faults, area and volume of a mesh as a surface. Vertices with equal coordinates count as one.")
      .def_readonly("components", &Health::components, "Number of pieces that share no vertex.")
      .def_readonly("open_edges", &Health::open_edges, "Number of edges of one triangle.")
      .def_readonly("non_manifold_edges", &Health::non_manifold_edges, "Number of edges of more than two triangles.")
      .def_readonly("flipped_edges", &Health::flipped_edges,
                    "Number of edges that two triangles have in the same direction.")
      .def_readonly("degenerate_triangles", &Health::degenerate_triangles,
                    "Number of triangles without area, up to rounding.")
      .def_readonly("duplicate_triangles", &Health::duplicate_triangles,
                    "Number of triangles with the corners of an earlier one, in any order.")
      .def_readonly("repeated_vertices", &Health::repeated_vertices,
                    "Number of vertices with the coordinates of an earlier one.")
      .def_readonly("unused_vertices", &Health::unused_vertices, "Number of vertices that no triangle has.")
      .def_readonly("area", &Health::area, "Of all triangles, in the square of the mesh's length unit.")
      .def_property_readonly(
          "volume",
          [](const Health& h) {
            return h.watertight() && h.oriented() ? std::optional<double>(h.volume) : std::nullopt;
          },
          "In the cube of the mesh's length unit, negative for a mesh that is inside out; None if the mesh is not "
          "watertight and oriented.")
      .def_property_readonly("watertight", &Health::watertight,
                             "True without open and non-manifold edges. solid needs oriented, too.")
      .def_property_readonly("oriented", &Health::oriented, "True without flipped edges.");

  py::class_<Mesh, MeshPtr>(m, "Mesh", R"(A triangle mesh: validated once, immutable, shared by any number of models.

vertices: (n, 3) real numbers in any length unit, of any dtype and layout; copied once, into doubles.
triangles: (m, 3) integers, 0 <= i < n.
Raises ValueError that names the first bad vertex or triangle.)")
      .def(py::init(&makeMesh), "vertices"_a, "triangles"_a)
      .def_property_readonly(
          "vertices", [](const py::object& self) { return rows<double>(self.cast<const Mesh&>().vertices(), 3, self); },
          "(n, 3) float64 in the mesh's frame; read-only, the mesh's own memory.")
      .def_property_readonly(
          "triangles",
          [](const py::object& self) { return rows<std::uint32_t>(self.cast<const Mesh&>().triangles(), 3, self); },
          "(m, 3) uint32; read-only, the mesh's own memory.")
      .def_property_readonly(
          "bounds",
          [](const Mesh& mesh) {
            py::array_t<double> a({2, 3});
            std::copy_n(mesh.bounds().min().data(), 3, a.mutable_data());
            std::copy_n(mesh.bounds().max().data(), 3, a.mutable_data() + 3);
            return a;
          },
          "(2, 3): minimum and maximum corner of the bounding box of all triangles, in the mesh's frame.")
      .def(
          "with_vertices",
          [](const Mesh& mesh, const py::object& vertices) {
            std::vector<Eigen::Vector3d> v = vectors("vertices", vertices);
            const NoGil free;
            return forPython(mesh.withVertices(std::move(v)));
          },
          "vertices"_a, "A mesh with the same triangles and these vertices, (n, 3). Both meshes share the indices.")
      .def("__reduce__",
           [](const py::object& self) {
             return py::make_tuple(py::type::of(self), py::make_tuple(self.attr("vertices"), self.attr("triangles")));
           })
      .def("health", &program::healthOf, py::call_guard<NoGil>(), "Checks the mesh as a surface; see Health.")
      .def("__repr__", [](const Mesh& mesh) {
        return "Mesh(" + counted(mesh.vertexCount(), "vertex", "vertices") + ", " +
               counted(mesh.triangleCount(), "triangle") + ")";
      });

  m.def("load_mesh", &loadMeshOf, "file"_a,
        R"(Reads a Mesh from an OBJ, PLY, STL, OFF or DAE file; assimp reads other formats.

Coordinates and axes are those of the file; coordinates of DAE are converted to metres. Raises RuntimeError that names
the file and its fault.)");
}

/// The nodes as arrays, one row each, parents before children.
py::dict nodesOf(const Modeld& model) {
  std::vector<NodeView> nodes;
  {
    const NoGil free;
    model.visit([&nodes](const NodeView& node) { nodes.push_back(node); });
  }
  const auto count = static_cast<py::ssize_t>(nodes.size());
  py::array_t<double> center({count, py::ssize_t{3}}), radius(count);
  py::array_t<std::int64_t> parent(count);
  py::array_t<std::int32_t> level(count), n(count), children(count);
  py::array_t<bool> is_cell(count);
  std::unordered_map<std::uint32_t, py::ssize_t> row_of_id;
  for (py::ssize_t i = 0; i < count; ++i) {
    const NodeView& node = nodes[static_cast<std::size_t>(i)];
    row_of_id[node.id] = i;
    for (int k = 0; k < 3; ++k) center.mutable_at(i, k) = node.center[k];
    radius.mutable_at(i) = node.radius;
    parent.mutable_at(i) = node.parent == NodeView::kNone ? -1 : row_of_id.at(node.parent);
    level.mutable_at(i) = node.level;
    n.mutable_at(i) = node.n;
    children.mutable_at(i) = static_cast<std::int32_t>(node.children.size());
    is_cell.mutable_at(i) = node.is_cell;
  }
  return py::dict("center"_a = center, "radius"_a = radius, "parent"_a = parent, "level"_a = level, "n"_a = n,
                  "children"_a = children, "is_cell"_a = is_cell);
}

std::pair<py::array_t<double>, py::array_t<double>> spheresOf(const MeshPtr& mesh, int depth,
                                                              const std::string& subdivision) {
  Options options;
  options.subdivision = valueOf("subdivision", subdivision, kSubdivisions);
  options.depth = depth;
  options.ttl = std::chrono::milliseconds(0);
  std::vector<NodeView> leaves;
  {
    const NoGil free;
    const std::shared_ptr<Modeld> model = makeModel(mesh, options);
    model->expandAll(depth);
    std::vector<NodeView> nodes;
    model->visit([&nodes](const NodeView& node) { nodes.push_back(node); });
    leaves = program::leavesAt(nodes, depth);
  }
  const auto count = static_cast<py::ssize_t>(leaves.size());
  py::array_t<double> centers({count, py::ssize_t{3}}), radii(count);
  for (py::ssize_t i = 0; i < count; ++i) {
    const NodeView& leaf = leaves[static_cast<std::size_t>(i)];
    for (int k = 0; k < 3; ++k) centers.mutable_at(i, k) = leaf.center[k];
    radii.mutable_at(i) = leaf.radius;
  }
  return {centers, radii};
}

void bindStatistics(py::module_& m) {
  py::class_<Statistics>(m, "Statistics", "A snapshot of a model's memory and of its work since it was made.")
      .def_readonly("resident_nodes", &Statistics::resident_nodes, "Number of nodes in memory; 1: only the root.")
      .def_readonly("resident_bytes", &Statistics::resident_bytes, "Heap bytes of the tree, without the mesh.")
      .def_readonly("nodes_per_level", &Statistics::nodes_per_level, "Number of nodes of level 1 (the root), 2, ...")
      .def_readonly("expansions", &Statistics::expansions, "Number of nodes expanded so far.")
      .def_readonly("oracle_batches", &Statistics::oracle_batches, "Number of batches that the oracle tested so far.")
      .def_readonly("oracle_cells", &Statistics::oracle_cells, "Number of cells that the oracle tested so far.")
      .def_readonly("expanded_octants", &Statistics::expanded_octants,
                    "Number of octants of expanded nodes that have an actual region, so far.")
      .def_readonly("built_triangles", &Statistics::built_triangles,
                    "Number of triangles that exact answers have sorted into the tree so far.")
      .def_readonly("pruned_nodes", &Statistics::pruned_nodes, "Number of nodes dropped so far.")
      .def_readonly("mesh_bytes", &Statistics::mesh_bytes, "Heap bytes of the mesh; other models may share them.")
      .def_readonly("device_bytes", &Statistics::device_bytes,
                    "Bytes on a GPU: the mesh, which other models may share, and lists of triangles.");
}

void bindModel(py::module_& m) {
  py::class_<ModelGeometry, Geometry, std::shared_ptr<ModelGeometry>>(
      m, "Model", R"(A triangle mesh as a geometry, with a sphere-tree.

The tree starts as one sphere; queries expand the nodes that they touch. Any number of threads may query one model.
Model(mesh, options), or options as keyword arguments: Model(mesh, margin=0.01). See Options.)")
      .def(py::init([](const MeshPtr& mesh, const std::optional<Options>& options, const py::kwargs& keywords) {
             if (options && !keywords.empty()) {
               throw py::type_error("bocst: Model takes options, or their names as keyword arguments, not both");
             }
             const Options o = options ? *options : py::type::of<Options>()(**keywords).cast<Options>();
             const NoGil free;
             return std::make_shared<ModelGeometry>(makeModel(mesh, o));
           }),
           "mesh"_a, "options"_a = py::none())
      .def_property_readonly(
          "mesh", [](const ModelGeometry& g) { return forPython(g.model().mesh()); },
          "The current Mesh; None after release_mesh().")
      .def("__reduce__",
           [](const py::object& self) {
             const py::object mesh = self.attr("mesh");
             if (mesh.is_none()) throw py::value_error("bocst: a Model without its mesh cannot be pickled");
             return py::make_tuple(py::type::of<ModelGeometry>(), py::make_tuple(mesh, self.attr("options")));
           })
      .def_property_readonly(
          "options", [](const ModelGeometry& g) { return g.model().options(); },
          "The Options that the model was made with.")
      .def_property_readonly(
          "oracle_name", [](const ModelGeometry& g) { return g.model().oracleName(); },
          "'cpu', 'occlusion', 'sampled', 'compute', or 'cpu and compute' ('auto' with a GPU).")
      .def(
          "statistics", [](const ModelGeometry& g) { return g.model().statistics(); }, py::call_guard<NoGil>(),
          "A snapshot; see Statistics.")
      .def(
          "build_tree", [](const ModelGeometry& g) { g.model().buildTree(); }, py::call_guard<NoGil>(),
          "Builds the whole tree of exact answers now, so that the next queries do not have to.")
      .def(
          "expand_all", [](const ModelGeometry& g, int depth) { g.model().expandAll(depth); }, "depth"_a,
          py::call_guard<NoGil>(),
          "Expands the whole tree down to this level (1 to 17). For inspection. Each level takes about four times the "
          "memory of the level above it: a deep one may take gigabytes.")
      .def(
          "nodes", [](const ModelGeometry& g) { return nodesOf(g.model()); },
          R"(The resident nodes as a dict of arrays, one row each, parents before children.

center (k, 3) and radius (k,) of the sphere in the mesh's frame and length unit; parent (k,): row of the parent, -1 for the
root; level (k,): 1 for the root; n (k,): 2^n is the side of the node's cube in lattice units; children (k,): number of
resident children; is_cell (k,): False for a node that exact answers build below a cell.)")
      .def(
          "prune", [](const ModelGeometry& g) { g.model().prune(); }, py::call_guard<NoGil>(),
          "Drops nodes that are unused for longer than ttl or exceed the memory budget. Queries also do this.")
      .def(
          "update_vertices",
          [](const ModelGeometry& g, const py::object& vertices) {
            std::vector<Eigen::Vector3d> v = vectors("vertices", vertices);
            const NoGil free;
            g.model().updateVertices(std::move(v));
          },
          "vertices"_a,
          "Sets new positions, (n, 3), of all vertices. The tree is reset to its root; nothing is rebuilt.")
      .def(
          "release_mesh", [](const ModelGeometry& g) { g.model().releaseMesh(); }, py::call_guard<NoGil>(),
          "Releases the mesh in host memory; a device keeps a copy. Exact answers read it back while they need it.")
      .def("__repr__", [](const ModelGeometry& g) {
        const std::shared_ptr<const Mesh> mesh = g.model().mesh();
        const std::string triangles = mesh ? counted(mesh->triangleCount(), "triangle") : "mesh released";
        const std::string answer = nameOf(g.model().options().answer, kAnswers);
        const NoGil free;
        return "Model(" + triangles + ", " + answer + ", " + counted(g.model().statistics().resident_nodes, "node") +
               ")";
      });
}

void bindSpheres(py::module_& m) {
  m.def("spheres", &spheresOf, "mesh"_a, "depth"_a = 6, "subdivision"_a = "bono",
        R"(Spheres that together contain the whole surface: the leaves of a tree that ends at level `depth` (1 to 17).

Returns (centers (k, 3), radii (k,)) in the mesh's frame and length unit. Each level has about four times as many
spheres as the level above it and takes about four times the memory: a deep one may take gigabytes.)");
}

void bindOracles(py::module_& m) {
  py::class_<OracleInfo>(m, "OracleInfo", "One oracle that this build supports; why_not is empty if it can be used.")
      .def_property_readonly(
          "kind", [](const OracleInfo& o) { return nameOf(o.kind, kOracles); }, "The value for Options.oracle.")
      .def_readonly("name", &OracleInfo::name, "The value for the environment variable BOCST_ORACLE; or 'sampled'.")
      .def_readonly("device", &OracleInfo::device, "Name of the device, for display.")
      .def_readonly("hardware", &OracleInfo::hardware, "True if it runs on a GPU.")
      .def_readonly("why_not", &OracleInfo::why_not, "Why it cannot be used; empty if it can.")
      .def_readonly("self_test", &OracleInfo::self_test,
                    "Result of the tests of the device before it is used; empty if there was no test.");
  m.def("available_oracles", &availableOracles, py::call_guard<NoGil>(),
        "Lists all oracles; for those that cannot be used, the reason.");
  py::register_exception<OracleError>(m, "OracleError", PyExc_RuntimeError).attr("__doc__") =
      "The oracle that was asked for cannot be used.";
}

// Many poses ----------------------------------------------------------------------------------------------------------

/// Calls f(begin, end) for the items below `count` in parts of at most `most`, without the GIL, until it returns false.
/// In between, the signals that came are handled, so Ctrl-C ends a long call.
template <typename F>
void inParts(std::size_t count, std::size_t most, const F& f) {
  constexpr std::chrono::milliseconds kPatience(100);
  std::size_t begin = 0;
  do {
    {
      const NoGil free;
      const auto start = std::chrono::steady_clock::now();
      do {
        const std::size_t end = std::min(begin + most, count);
        if (!f(begin, end)) return;
        begin = end;
      } while (begin < count && std::chrono::steady_clock::now() - start < kPatience);
    }
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
  } while (begin < count);
}

py::array_t<bool> posesOf(const ModelGeometry& a, const ModelGeometry& b, const py::object& X_AB, unsigned threads) {
  const Poses poses("X_AB", X_AB);
  if (poses.shape().size() != 1) {
    throw py::value_error("bocst: X_AB has the shape " + shapeOf(poses.shape()) + "; (n, 4, 4) is expected");
  }
  py::array_t<bool> hits(poses.shape());
  auto* hit = reinterpret_cast<std::uint8_t*>(hits.mutable_data());
  const std::shared_ptr<Modeld> model_a = a.shared(), model_b = b.shared();
  std::vector<fcl::Transform3d> copy;
  const auto check = [&](std::size_t begin, std::size_t end) {
    if (poses.order().has_value()) {
      collidePoses(*model_a, *model_b, poses.data() + 16 * begin, *poses.order(), end - begin, hit + begin, threads);
    } else {
      collidePoses(*model_a, *model_b, poses.transforms(begin, end, copy), end - begin, hit + begin, threads);
    }
  };
  // Each part starts its threads.
  const std::size_t most = poses.order().has_value() ? std::size_t{1} << 18 : std::size_t{1} << 15;
  inParts(poses.count(), most, [&](std::size_t begin, std::size_t end) {
    try {
      check(begin, end);
    } catch (const std::invalid_argument&) {
      if (begin > 0) check(0, end);  // so that the message has the pose's number in the whole array
      throw;
    }
    return true;
  });
  return hits;
}

/// A scene whose number of moving objects does not change while a query reads the poses of a state.
struct PyScene {
  explicit PyScene(const SceneOptions& options) : scene(options) {}
  Scened scene;
  mutable FairSharedMutex changing;
};

/// Changes of that number wait for queries. Needs no GIL.
template <typename F>
auto change(PyScene& s, const F& f) {
  const NoGilWithOctrees free;
  const std::lock_guard<FairSharedMutex> alone(s.changing);
  return f(s.scene);
}

/// How many states there are in an array of shape (..., moving, 4, 4); with one moving object also (..., 4, 4).
std::size_t statesIn(const char* name, const Poses& poses, std::size_t moving, bool many) {
  const std::vector<py::ssize_t>& shape = poses.shape();
  const std::size_t dimensions = many ? 2 : 1;
  const bool has_moving = shape.size() == dimensions && shape.back() == static_cast<py::ssize_t>(moving);
  if (!has_moving && !(moving == 1 && shape.size() == dimensions - 1)) {
    throw py::value_error("bocst: " + std::string(name) + " has the shape " + shapeOf(shape) + "; (" +
                          (many ? "n, " : "") + std::to_string(moving) + ", 4, 4) is expected, as the scene has " +
                          counted(moving, "moving object"));
  }
  return many ? static_cast<std::size_t>(shape.front()) : 1;
}

/// Calls f(scene, poses) for one state, without the GIL.
template <typename F>
auto ask(const PyScene& s, const py::object& X_WM, const F& f, const char* name = "X_WM") {
  const Poses poses(name, X_WM);
  const NoGilWithOctrees free;
  const std::shared_lock<FairSharedMutex> lock(s.changing);
  statesIn(name, poses, s.scene.movingCount(), false);
  std::vector<fcl::Transform3d> copy;
  return f(s.scene, poses.transforms(0, poses.count(), copy));
}

/// Calls start(states), then f(scene, poses, first state, number of states) for parts of many states in turn, until it
/// returns false. A change of the scene by another thread may come between two parts.
template <typename Start, typename F>
void askMany(const PyScene& s, const py::object& X_WM, const Start& start, const F& f) {
  constexpr std::size_t kPoses = 1 << 15, kMost = 4096;
  const Poses poses("X_WM", X_WM);
  const std::size_t moving = s.scene.movingCount(), states = statesIn("X_WM", poses, moving, true);
  start(states);
  std::vector<fcl::Transform3d> copy;
  const auto part = [&](std::size_t begin, std::size_t end) {
    const std::shared_lock<FairSharedMutex> octrees(octreeMutex());
    const std::shared_lock<FairSharedMutex> lock(s.changing);
    if (s.scene.movingCount() != moving) {
      throw std::runtime_error("bocst: moving objects came or went while the scene was asked");
    }
    return f(s.scene, poses.transforms(begin * moving, end * moving, copy), begin, end - begin);
  };
  inParts(states, std::clamp<std::size_t>(kPoses / std::max<std::size_t>(1, moving), 128, kMost),
          [&](std::size_t begin, std::size_t end) {
            try {
              return part(begin, end);
            } catch (const std::invalid_argument&) {
              if (begin > 0) part(0, end);  // so that the message has the state's number in the whole array
              throw;
            }
          });
}

using Xs = const fcl::Transform3d*;

/// A query of Python about one state.
template <typename F>
auto query(const F& f) {
  return [f](const PyScene& s, const py::object& X_WM) { return ask(s, X_WM, f); };
}

py::list pairsOf(const std::vector<Pair>& pairs) {
  py::list list;
  for (const Pair& p : pairs) list.append(py::make_tuple(p.a, p.b));
  return list;
}

py::tuple pairsWithin(const PyScene& s, const py::object& X_WM, double distance) {
  const auto found = ask(s, X_WM, [distance](const Scened& scene, Xs X) { return scene.pairsWithin(X, distance); });
  const auto count = static_cast<py::ssize_t>(found.size());
  std::vector<Pair> pairs;
  py::array_t<double> distances(count), points({count, py::ssize_t{2}, py::ssize_t{3}});
  for (const PairDistance<double>& p : found) {
    const auto row = static_cast<py::ssize_t>(pairs.size());
    pairs.push_back(p.pair);
    distances.mutable_at(row) = p.distance;
    for (int i = 0; i < 2; ++i) {
      for (int k = 0; k < 3; ++k) points.mutable_at(row, i, k) = p.nearest_points[i][k];
    }
  }
  return py::make_tuple(pairsOf(pairs), distances, points);
}

constexpr double kAnyDistance = std::numeric_limits<double>::infinity();

std::optional<std::pair<Id, Id>> idsOf(const Pair& pair) {
  return pair.a.isValid() ? std::optional<std::pair<Id, Id>>({pair.a, pair.b}) : std::nullopt;
}

void bindCollidePoses(py::module_& m) {
  m.def("collide_poses", &posesOf, "a"_a, "b"_a, "X_AB"_a, py::kw_only(), "threads"_a = 0,
        R"(Checks one pair of models for collision at many poses. Returns a bool array (n,), as fcl.collide answers.

a, b: Model.
X_AB: (n, 4, 4) poses of b in the frame of a, in the length unit of the meshes. float64 arrays in C order are not copied,
nor are those with matrices in column-major order (np.swapaxes(X, 1, 2) of an array in C order).
threads: number of threads that share the poses; 0: one for every 4096 poses, at most one per hardware thread.
Pass 1 if your own threads or processes call this at the same time.)");
}

void bindId(py::module_& m) {
  py::class_<Id>(m, "Id", "Identifies an object of one Scene.")
      .def("__bool__", &Id::isValid)
      .def("__hash__", [](Id id) { return std::hash<Id>()(id); })
      .def("__repr__", [](Id id) { return py::str("Id({:#x})").format(std::hash<Id>()(id)); })
      .def(py::self == py::self)
      .def(py::self != py::self)
      .def(py::self < py::self);
}

py::class_<PyScene> bindScene(py::module_& m) {
  py::class_<PyScene> type(
      m, "Scene",
      R"(The collision queries of a planner for a robot among obstacles: one call checks whole states.

Geometries are bocst.Model and those of bocst.fcl. A state is an array (m, 4, 4): the poses of all m moving objects, world
from geometry, in the order in which they were added. Many states are (n, m, 4, 4); with m = 1 also (n, 4, 4).
Verdicts are those of fcl.collide for each pair of a moving object and another object that is not ignored.
threads: number of threads that share the states of one call; 0: one per hardware thread.)");
  type.def(py::init([](unsigned threads) {
             SceneOptions options;
             options.threads = threads;
             return std::make_unique<PyScene>(options);
           }),
           py::kw_only(), "threads"_a = 1)
      .def("__repr__",
           [](const PyScene& s) {
             return "Scene(" + std::to_string(s.scene.fixedCount()) + " fixed, " +
                    std::to_string(s.scene.movingCount()) + " moving, " + counted(s.scene.pairCount(), "pair") + ")";
           })
      .def_property_readonly(
          "moving_count", [](const PyScene& s) { return s.scene.movingCount(); },
          "Number of moving objects: m of a state, (m, 4, 4).")
      .def_property_readonly(
          "fixed_count", [](const PyScene& s) { return s.scene.fixedCount(); }, "Number of fixed objects.")
      .def_property_readonly(
          "pair_count", [](const PyScene& s) { return s.scene.pairCount(); }, "Number of pairs that are not ignored.")
      .def(
          "moving_index", [](const PyScene& s, Id moving) { return s.scene.movingIndex(moving); }, "moving"_a,
          "The index of a moving object among the poses of a state.");
  return type;
}

void bindSceneChanges(py::class_<PyScene>& type) {
  type.def(
          "add_fixed",
          [](PyScene& s, const Geometry& geometry, const py::object& X_WG) {
            const fcl::Transform3d X = pose("X_WG", X_WG);
            return change(s, [&, g = geometry.get()](Scened& scene) { return scene.addFixed(g, X); });
          },
          "geometry"_a, "X_WG"_a, "Adds an object that stays at X_WG, (4, 4), world from geometry.")
      .def(
          "add_moving",
          [](PyScene& s, const Geometry& geometry) {
            return change(s, [g = geometry.get()](Scened& scene) { return scene.addMoving(g); });
          },
          "geometry"_a, "Adds an object whose pose is part of each state.")
      .def(
          "remove", [](PyScene& s, Id id) { change(s, [id](Scened& scene) { scene.remove(id); }); }, "object"_a,
          "Removes an object. The other moving objects keep their order.")
      .def(
          "set_pose",
          [](PyScene& s, Id fixed, const py::object& X_WG) {
            const fcl::Transform3d X = pose("X_WG", X_WG);
            const NoGilWithOctrees free;
            s.scene.setPose(fixed, X);
          },
          "fixed"_a, "X_WG"_a, "Moves a fixed object to another pose, (4, 4).")
      .def(
          "ignore", [](PyScene& s, Id a, Id b, bool ignored) { s.scene.ignore(a, b, ignored); }, "a"_a, "b"_a,
          "ignored"_a = true, py::call_guard<NoGilWithOctrees>(), "Allows the two to touch; ignored=False undoes this.")
      .def(
          "update", [](PyScene& s, Id id) { s.scene.update(id); }, "object"_a, py::call_guard<NoGilWithOctrees>(),
          "Call this after the shape of a geometry has changed. A BVHModel that was built again is another geometry: "
          "remove the object and add it again.")
      .def(
          "build_trees", [](PyScene& s) { s.scene.buildTrees(); }, py::call_guard<NoGil>(),
          "Builds the whole trees of all models with exact answers now, with the scene's threads, so that no query has "
          "to. A model with ttl=0 keeps its tree.");
}

void bindSceneQueries(py::class_<PyScene>& type) {
  type.def("collides", query([](const Scened& scene, Xs X) { return scene.collides(X); }), "X_WM"_a,
           "True if this state, (m, 4, 4), collides.")
      .def("colliding_pair", query([](const Scened& scene, Xs X) {
             Pair pair;
             scene.collides(X, &pair);
             return idsOf(pair);
           }),
           "X_WM"_a,
           "A pair of Ids that collides in this state, (m, 4, 4), or None. If several do, it may be any of them: it "
           "depends on earlier queries. The first of colliding_pairs() does not.")
      .def(
          "colliding_pairs",
          [](const PyScene& s, const py::object& X_WM) {
            return pairsOf(ask(s, X_WM, [](const Scened& scene, Xs X) { return scene.collidingPairs(X); }));
          },
          "X_WM"_a, "A list of all pairs of Ids that collide in this state, (m, 4, 4), in the order of the Ids.")
      .def(
          "collisions",
          [](const PyScene& s, const py::object& X_WM) {
            py::array_t<bool> hits;
            std::uint8_t* hit = nullptr;
            askMany(
                s, X_WM,
                [&](std::size_t states) {
                  hits = py::array_t<bool>(static_cast<py::ssize_t>(states));
                  hit = reinterpret_cast<std::uint8_t*>(hits.mutable_data());
                },
                [&](const Scened& scene, Xs X, std::size_t begin, std::size_t states) {
                  scene.collisions(X, states, hit + begin);
                  return true;
                });
            return hits;
          },
          "X_WM"_a, "A bool array (n,): True for each of the states, (n, m, 4, 4), that collides.")
      .def(
          "first_collision",
          [](const PyScene& s, const py::object& X_WM) {
            std::size_t first = 0;
            askMany(
                s, X_WM, [](std::size_t) {},
                [&first](const Scened& scene, Xs X, std::size_t begin, std::size_t states) {
                  const std::size_t found = scene.firstCollision(X, states);
                  first = begin + found;
                  return found == states;
                });
            return first;
          },
          "X_WM"_a, "The smallest index of a state that collides; n if none does. The states are (n, m, 4, 4).")
      .def(
          "any_collision",
          [](const PyScene& s, const py::object& X_WM) {
            bool any = false;
            askMany(
                s, X_WM, [](std::size_t) {},
                [&any](const Scened& scene, Xs X, std::size_t, std::size_t states) {
                  any = scene.anyCollision(X, states);
                  return !any;
                });
            return any;
          },
          "X_WM"_a,
          "True if any of the states, (n, m, 4, 4), collides. Checks the middle of each part before its halves.")
      .def(
          "clearance",
          [](const PyScene& s, const py::object& X_WM, double at_most) {
            return ask(s, X_WM, [at_most](const Scened& scene, Xs X) { return scene.clearance(X, nullptr, at_most); });
          },
          "X_WM"_a, "at_most"_a = kAnyDistance,
          "The minimum distance of all pairs in this state, (m, 4, 4); 0 if a pair touches; at_most if no pair is "
          "nearer, so that farther ones need not be measured.")
      .def("nearest_pair", query([](const Scened& scene, Xs X) {
             Pair pair;
             scene.clearance(X, &pair);
             return idsOf(pair);
           }),
           "X_WM"_a, "The pair of Ids at the minimum distance in this state, (m, 4, 4); None without pairs.")
      .def(
          "clearances",
          [](const PyScene& s, const py::object& X_WM, double at_most) {
            py::array_t<double> distances;
            double* distance = nullptr;
            askMany(
                s, X_WM,
                [&](std::size_t states) {
                  distances = py::array_t<double>(static_cast<py::ssize_t>(states));
                  distance = distances.mutable_data();
                },
                [&](const Scened& scene, Xs X, std::size_t begin, std::size_t states) {
                  scene.clearances(X, states, distance + begin, nullptr, at_most);
                  return true;
                });
            return distances;
          },
          "X_WM"_a, "at_most"_a = kAnyDistance,
          "A float64 array (n,): the clearance of each of the states, (n, m, 4, 4), see clearance(). The scene's "
          "threads share them.")
      .def("pairs_within", &pairsWithin, "X_WM"_a, "distance"_a,
           R"(All pairs whose distance in this state, (m, 4, 4), is at most `distance`; the nearest first.

Returns (pairs, distances, points): a list of k pairs of Ids; float64 (k,), 0 for a pair that touches; float64 (k, 2, 3),
the nearest points on the first and the second object in the world, without meaning if the two touch.)")
      .def(
          "edge_is_free",
          [](const PyScene& s, const py::object& begin, const py::object& end, const std::string& motion) {
            const auto motion_type = valueOf("motion", motion, kMotions);
            const Poses last("X_WM_end", end);
            const auto is_free = [&](const Scened& scene, Xs X) {
              statesIn("X_WM_end", last, scene.movingCount(), false);
              std::vector<fcl::Transform3d> copy;
              return scene.edgeIsFree(X, last.transforms(0, last.count(), copy), motion_type);
            };
            return ask(s, begin, is_free, "X_WM_begin");
          },
          "X_WM_begin"_a, "X_WM_end"_a, "motion"_a = "linear",
          R"(True if the motion from one state to another, both (m, 4, 4), is free of collisions at all times.

Each object moves on its own: by default its origin along a line, while it turns about a fixed axis. The links of an arm
that moves in joint space leave that motion: divide such an edge, or ask any_collision() about states on it.
motion: 'linear', 'translation', 'screw' or 'spline', see fcl.CCDMotionType.)");
}

/// Objects that were made without __init__ raise TypeError. pickle's oldest protocols would make such an object, at
/// which pybind11 ends the process; X.__new__(X) makes one for which pybind11 hands C++ memory that holds no object.
void requireInit(const py::module_& m) {
  for (const auto& item : m.attr("__dict__").cast<py::dict>()) {
    const py::handle value = item.second;
    if (py::isinstance<py::module_>(value)) {
      requireInit(value.cast<py::module_>());
      continue;
    }
    if (PyType_Check(value.ptr()) == 0 || PyExceptionClass_Check(value.ptr())) continue;
    const bool is_pickled = py::dict(value.attr("__dict__")).contains("__reduce__");
    py::detail::get_type_info(reinterpret_cast<PyTypeObject*>(value.ptr()))->operator_new = [](std::size_t) -> void* {
      throw py::type_error("bocst: __init__ of the object was not called");
    };
    if (py::hasattr(value, "__members__")) {
      // Of all protocols of pickle; the oldest would make an object without __init__.
      const auto reduce = [](const py::object& self, const py::args&) {
        return py::make_tuple(py::type::of(self), py::make_tuple(py::int_(self)));
      };
      py::setattr(value, "__reduce_ex__", py::cpp_function(reduce, py::is_method(value), py::name("__reduce_ex__")));
    } else if (is_pickled) {
      const auto reduce = [](const py::object& self, const py::args&) { return self.attr("__reduce__")(); };
      py::setattr(value, "__reduce_ex__", py::cpp_function(reduce, py::is_method(value), py::name("__reduce_ex__")));
    } else {
      const auto refuse = [](const py::object& self, const py::args&) {
        throw py::type_error("cannot pickle '" + std::string(Py_TYPE(self.ptr())->tp_name) + "' object");
      };
      for (const char* name : {"__reduce__", "__reduce_ex__"}) {
        py::setattr(value, name, py::cpp_function(refuse, py::is_method(value), py::name(name)));
      }
    }
  }
}

/// Classes without a __repr__ get one that names their properties, in one line.
void addReprs(const py::module_& m) {
  for (const auto& item : m.attr("__dict__").cast<py::dict>()) {
    const py::handle value = item.second;
    if (py::isinstance<py::module_>(value)) addReprs(value.cast<py::module_>());
    if (PyType_Check(value.ptr()) == 0 || PyExceptionClass_Check(value.ptr())) continue;
    const auto members = py::dict(value.attr("__dict__"));
    std::vector<py::str> names;
    for (const auto& [name, member] : members) {
      if (py::isinstance(member, py::handle(reinterpret_cast<PyObject*>(&PyProperty_Type)))) names.emplace_back(name);
    }
    if (names.empty() || members.contains("__repr__")) continue;
    const auto text = [names](const py::object& self) {
      std::string fields;
      for (const py::str& name : names) {
        py::object field = self.attr(name);
        if (py::isinstance<py::array>(field)) field = field.attr("tolist")();
        if (py::hasattr(field, "__members__")) field = field.attr("name");
        fields += (fields.empty() ? "" : ", ") + std::string(name) + "=" + std::string(py::repr(field));
      }
      return std::string(py::str(py::type::of(self).attr("__name__"))) + "(" + fields + ")";
    };
    py::setattr(value, "__repr__", py::cpp_function(text, py::is_method(value), py::name("__repr__")));
  }
}

}  // namespace

PYBIND11_MODULE(_bocst, m) {
  m.doc() = "The C++ part of bocst.";
  m.attr("__version__") = BOCST_VERSION;
  bindOptions(m);
  bindMesh(m);
  bindFcl(m.def_submodule("fcl"));
  bindStatistics(m);
  bindModel(m);
  bindSpheres(m);
  bindOracles(m);
  bindCollidePoses(m);
  bindId(m);
  py::class_<PyScene> scene_type = bindScene(m);
  bindSceneChanges(scene_type);
  bindSceneQueries(scene_type);
  addReprs(m);
  requireInit(m);
}

}  // namespace bocst::python
