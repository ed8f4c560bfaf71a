// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/fcl.h>
#include <bocst/unchecked_dispatch.h>
#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/octree/octree.h>
#include <pthread.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <limits>
#include <mutex>
#include <optional>
#include <sstream>
#include <string_view>

#include "python/arrays.h"
#include "python/geometry.h"

// bocst.fcl: FCL's queries under python-fcl's names.

// Functions named bind... are lists with a line or two for each name of Python, so they are as long as that list.
namespace bocst::python {
namespace {

using namespace pybind11::literals;
using Eigen::Vector3d;
using fcl::Transform3d;
using GeometryPtr = std::shared_ptr<fcl::CollisionGeometryd>;

double number(const char* name, double value) {
  if (!std::isfinite(value)) throw py::value_error(std::string("bocst: ") + name + " is not finite");
  return value;
}
double length(const char* name, double value) {
  if (!(number(name, value) >= 0)) throw py::value_error(std::string("bocst: ") + name + " is negative");
  return value;
}
/// octomap counts cells in 16 bits, and divides by their size.
double cellSize(double resolution) {
  if (!(length("r", resolution) > 1e-100)) throw py::value_error("bocst: r, the size of a cell, must be more than 0");
  return resolution;
}
Vector3d lengths(const char* name, const py::object& value) {
  const Vector3d v = vector3(name, value);
  for (int k = 0; k < 3; ++k) length(name, v[k]);
  return v;
}
Vector3d normal(const py::object& value) {
  const Vector3d n = vector3("n", value);
  if (n.isZero()) throw py::value_error("bocst: n is the zero vector");
  return n;
}

py::array arrayOfAny(const char* name, const py::object& value) {
  const py::array a = py::array::ensure(value);
  if (!a) {
    PyErr_Clear();
    throw py::value_error(std::string("bocst: ") + name + " is not an array of numbers");
  }
  return a;
}

// Poses ---------------------------------------------------------------------------------------------------------------

Eigen::Matrix3d rotation(const py::object& value) {
  const Eigen::Matrix3d R = matrix3("the rotation", value);
  const double error = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error <= 1e-3) || R.determinant() < 0) {
    throw py::value_error("bocst: the rotation is not a rotation matrix: R^T R differs from the identity by " +
                          std::to_string(error) + ", the determinant is " + std::to_string(R.determinant()));
  }
  return R;
}

Eigen::Matrix3d quaternion(const py::object& value) {
  const auto q = doubles("the quaternion", value);
  if (q.ndim() != 1 || q.shape(0) != 4) throw py::value_error("bocst: the quaternion must be (4,): w, x, y, z");
  const Eigen::Quaterniond Q(q.at(0), q.at(1), q.at(2), q.at(3));
  if (!(Q.norm() > 0) || !std::isfinite(Q.norm())) throw py::value_error("bocst: the quaternion is zero or not finite");
  return Q.normalized().toRotationMatrix();
}

py::array_t<double> quaternionOf(const Eigen::Matrix3d& R) {
  const Eigen::Quaterniond q(R);
  const double values[4] = {q.w(), q.x(), q.y(), q.z()};
  return py::array_t<double>(4, values);
}

/// (3, 3) or a quaternion.
Eigen::Matrix3d anyRotation(const py::object& value) {
  return arrayOfAny("the rotation", value).ndim() == 1 ? quaternion(value) : rotation(value);
}

/// A translation as python-fcl takes it, also (1, 3) or (3, 1).
Vector3d translation(const py::object& value) {
  return vector3("the translation", doubles("the translation", value).squeeze());
}

Transform3d transformOf(const py::object& R, const py::object& t) {
  Transform3d X = Transform3d::Identity();
  X.linear() = anyRotation(R);
  X.translation() = translation(t);
  return X;
}

Transform3d transformOf(const py::object& value) {
  if (py::isinstance<Transform3d>(value)) return value.cast<Transform3d>();
  Transform3d X = Transform3d::Identity();
  const auto a = doubles("the argument of Transform", value);
  if (a.ndim() == 1 && a.shape(0) == 3) {
    X.translation() = vector3("the translation", a);
  } else {
    X.linear() = anyRotation(a);
  }
  return X;
}

void bindTransform(py::module_& m) {
  py::class_<Transform3d>(m, "Transform", R"(A rigid pose: world from geometry.

Transform(), Transform(t), Transform(R), Transform(q), Transform(R, t), Transform(q, t) or Transform(other), with a
translation t (3,), a rotation R (3, 3), a quaternion q (4,): w, x, y, z, which is normalised.)")
      .def(py::init([] { return Transform3d(Transform3d::Identity()); }))
      .def(py::init([](const py::object& value) { return transformOf(value); }), "value"_a)
      .def(py::init([](const py::object& R, const py::object& t) { return transformOf(R, t); }), "R"_a, "t"_a)
      .def(
          "getRotation", [](const Transform3d& X) { return arrayOf(Eigen::Matrix3d(X.linear())); }, "(3, 3)")
      .def(
          "getTranslation", [](const Transform3d& X) { return arrayOf(Vector3d(X.translation())); }, "(3,)")
      .def(
          "getQuatRotation", [](const Transform3d& X) { return quaternionOf(X.linear()); }, "(4,): w, x, y, z")
      .def(
          "setRotation", [](Transform3d& X, const py::object& R) { X.linear() = rotation(R); }, "R"_a)
      .def(
          "setTranslation", [](Transform3d& X, const py::object& t) { X.translation() = translation(t); }, "T"_a)
      .def(
          "setQuatRotation", [](Transform3d& X, const py::object& q) { X.linear() = quaternion(q); }, "q"_a)
      .def("__repr__", [](const Transform3d& X) {
        const auto text = [](const py::object& a) { return std::string(py::str(a.attr("tolist")())); };
        return "Transform(q=" + text(quaternionOf(X.linear())) + ", t=" + text(arrayOf(Vector3d(X.translation()))) +
               ")";
      });
}

// Geometries ----------------------------------------------------------------------------------------------------------

template <typename T>
class Shape : public Geometry {
 public:
  template <typename... Args>
  explicit Shape(const Args&... args) : Geometry(std::make_shared<T>(args...)) {}
  T& shape() const { return static_cast<T&>(*geometry_); }
};

template <typename T>
using ShapeClass = py::class_<Shape<T>, Geometry, std::shared_ptr<Shape<T>>>;

/// A member of the shape as a property; `check` turns what Python gives into a value.
template <typename T, typename Member, typename Check>
void member(ShapeClass<T>& c, const char* name, Member T::*at, Check check, const char* text) {
  const auto get = [at](const Shape<T>& s) {
    if constexpr (std::is_same_v<Member, double>) {
      return s.shape().*at;
    } else {
      return arrayOf(Vector3d(s.shape().*at));
    }
  };
  const auto set = [name, at, check](const Shape<T>& s, const py::object& value) {
    if constexpr (std::is_same_v<Member, double>) {
      s.shape().*at = check(name, value.cast<double>());
    } else {
      s.shape().*at = check(name, value);
    }
    s.shape().computeLocalAABB();
  };
  c.def_property(name, get, set, text);
}

template <typename T>
void bindRound(py::module_& m, const char* name, const char* text) {
  ShapeClass<T> c(m, name, text);
  c.def(py::init([](double r, double lz) { return std::make_shared<Shape<T>>(length("radius", r), length("lz", lz)); }),
        "radius"_a, "lz"_a);
  member(c, "radius", &T::radius, length, "In the length unit of the geometries.");
  member(c, "lz", &T::lz, length, "Along z, in the length unit of the geometries.");
}

template <typename T>
void bindHalf(py::module_& m, const char* name, const char* text) {
  ShapeClass<T> c(m, name, text);
  c.def(py::init([](const py::object& n, double d) { return std::make_shared<Shape<T>>(normal(n), number("d", d)); }),
        "n"_a, "d"_a);
  member(
      c, "n", &T::n, [](const char*, const py::object& n) { return normal(n).stableNormalized().eval(); },
      "(3,): unit vector in the geometry's frame; a new value is normalised.");
  member(c, "d", &T::d, number, "Offset along n from the origin, in the length unit of the geometries.");
}

/// FCL goes through the faces without looking where they end.
std::shared_ptr<const std::vector<int>> facesOf(const py::object& faces, int count, std::size_t vertices) {
  std::vector<int> f;
  for (const auto& face : arrayOfAny("faces", faces).attr("ravel")().attr("tolist")()) {
    if (!py::isinstance<py::int_>(face)) throw py::type_error("bocst: faces: an array of whole numbers is expected");
    f.push_back(face.cast<int>());
  }
  std::size_t at = 0;
  for (int k = 0; k < count; ++k) {
    const int corners = at < f.size() ? f[at] : 0;
    if (corners < 3 || f.size() - at <= static_cast<std::size_t>(corners)) {
      throw py::value_error(
          "bocst: face " + std::to_string(k) +
          " of the Convex is incomplete: the number of corners (at least 3) is expected, then that many indices");
    }
    for (int i = 1; i <= corners; ++i) {
      const int v = f[at + static_cast<std::size_t>(i)];
      if (v < 0 || static_cast<std::size_t>(v) >= vertices) {
        throw py::value_error("bocst: face " + std::to_string(k) + " of the Convex has the index " + std::to_string(v) +
                              ", which no vertex has");
      }
    }
    at += static_cast<std::size_t>(corners) + 1;
  }
  if (count < 1 || at != f.size()) throw py::value_error("bocst: num_faces is not the number of faces of the Convex");
  return std::make_shared<const std::vector<int>>(std::move(f));
}

std::shared_ptr<Shape<fcl::Convexd>> makeConvex(const py::object& vertices, int num_faces, const py::object& faces) {
  auto v = std::make_shared<std::vector<Vector3d>>(vectors("vertices", vertices));
  for (const Vector3d& p : *v) {
    if (!p.allFinite()) throw py::value_error("bocst: a vertex of the Convex is not finite");
  }
  const auto f = facesOf(faces, num_faces, v->size());
  return std::make_shared<Shape<fcl::Convexd>>(std::shared_ptr<const std::vector<Vector3d>>(v), num_faces, f);
}

/// Gathers a mesh as FCL's BVHModel does, and then makes what it is for.
template <typename Make>
class Builder : public Geometry {
 public:
  Builder() : Geometry(nullptr) {}

  GeometryPtr get() const override {
    if (geometry_ == nullptr) throw py::value_error("bocst: the BVHModel is not built; call endModel()");
    return geometry_;
  }
  std::size_t triangles() const { return mesh_ != nullptr ? mesh_->triangleCount() : indices_.size(); }
  int state() const {
    return begun_      ? fcl::BVH_BUILD_STATE_BEGUN
           : geometry_ ? fcl::BVH_BUILD_STATE_PROCESSED
                       : fcl::BVH_BUILD_STATE_EMPTY;
  }

  int begin(std::size_t triangles, std::size_t vertices) {
    geometry_ = nullptr;
    mesh_ = nullptr;
    vertices_.clear();
    indices_.clear();
    vertices_.reserve(vertices);
    indices_.reserve(triangles);
    begun_ = true;
    return fcl::BVH_OK;
  }
  bool addVertex(double x, double y, double z) {
    inSequence();
    vertices_.emplace_back(x, y, z);
    return true;
  }
  bool addTriangle(const py::object& v1, const py::object& v2, const py::object& v3) {
    inSequence();
    const auto first = static_cast<std::uint32_t>(vertices_.size());
    vertices_.insert(vertices_.end(), {vector3("a corner", v1), vector3("a corner", v2), vector3("a corner", v3)});
    indices_.push_back({first, first + 1, first + 2});
    return true;
  }
  bool addSubModel(const py::object& verts, const py::object& triangles) {
    inSequence();
    const std::vector<Vector3d> v = vectors("verts", verts);
    std::vector<Mesh::Indices> t = indices("triangles", triangles);
    for (Mesh::Indices& triangle : t) {
      for (std::uint32_t& i : triangle) {
        if (i >= v.size()) {
          throw py::value_error("bocst: triangles has the index " + std::to_string(i) +
                                ", which no vertex of verts has");
        }
        i += static_cast<std::uint32_t>(vertices_.size());
      }
    }
    vertices_.insert(vertices_.end(), v.begin(), v.end());
    indices_.insert(indices_.end(), t.begin(), t.end());
    return true;
  }
  int end() {
    inSequence();
    begun_ = false;  // What another thread adds meanwhile is refused.
    std::vector<Vector3d> vertices = std::move(vertices_);
    std::vector<Mesh::Indices> triangles = std::move(indices_);
    std::shared_ptr<const Mesh> mesh;
    GeometryPtr geometry;
    {
      const NoGil free;
      mesh = Mesh::fromIndices(std::move(vertices), std::move(triangles));
      geometry = Make()(mesh);
    }
    mesh_ = std::move(mesh);
    geometry_ = std::move(geometry);
    return fcl::BVH_OK;
  }

 private:
  void inSequence() const {
    if (!begun_) throw py::value_error("bocst: the BVHModel is not being built; call beginModel()");
  }

  bool begun_ = false;
  std::vector<Vector3d> vertices_;
  std::vector<Mesh::Indices> indices_;
  std::shared_ptr<const Mesh> mesh_;
};

struct MakeModel {
  GeometryPtr operator()(const std::shared_ptr<const Mesh>& mesh) const { return makeModel(mesh, Options()); }
};
struct MakeObbrss {
  GeometryPtr operator()(const std::shared_ptr<const Mesh>& mesh) const {
    std::vector<fcl::Triangle> triangles(mesh->triangleCount());
    for (std::size_t t = 0; t < triangles.size(); ++t) triangles[t] = mesh->triangle(t);
    auto bvh = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
    bvh->beginModel(static_cast<int>(triangles.size()), static_cast<int>(mesh->vertexCount()));
    bvh->addSubModel(mesh->vertices(), triangles);
    bvh->endModel();
    return bvh;
  }
};

template <typename Make>
void bindBuilder(py::module_& m, const char* name, const char* text) {
  using B = Builder<Make>;
  py::class_<B, Geometry, std::shared_ptr<B>>(m, name, text)
      .def(py::init<>())
      .def("num_tries_", &B::triangles)
      .def("buildState", &B::state)
      .def("beginModel", &B::begin, "num_tris_"_a = 0, "num_vertices_"_a = 0)
      .def("addVertex", &B::addVertex, "x"_a, "y"_a, "z"_a)
      .def("addTriangle", &B::addTriangle, "v1"_a, "v2"_a, "v3"_a, "Three corners, (3,) each.")
      .def("addSubModel", &B::addSubModel, "verts"_a, "triangles"_a, "(n, 3) numbers and (m, 3) indices of them.")
      .def("endModel", &B::end)
      .def("__repr__",
           [name](const B& b) { return std::string(name) + "(" + counted(b.triangles(), "triangle") + ")"; });
}

#if FCL_HAVE_OCTOMAP
/// True if this is the data part of octomap's binary format, of a tree that is no deeper than octomap's. Its reader
/// takes what is beyond the end for nodes, and calls itself for each level. A node is two bits for each child; both are
/// set for a child that is a node again, which follows.
bool isBinaryOctree(std::string_view data) {
  constexpr int kDeepest = 16;
  std::vector<int> levels{0};  // of the nodes to come, the next one last
  while (!levels.empty()) {
    const int level = levels.back();
    levels.pop_back();
    if (data.size() < 2) return false;
    for (int child = 0; child < 8; ++child) {
      if ((data[static_cast<std::size_t>(child / 4)] >> (2 * (child % 4)) & 3) != 3) continue;
      if (level + 1 >= kDeepest) return false;
      levels.push_back(level + 1);
    }
    data.remove_prefix(2);
  }
  return data.empty();
}

bool isFile(std::string_view data) {
  constexpr std::string_view kFirst = "# Octomap OcTree binary file";
  return data.substr(0, kFirst.size()) == kFirst;
}

/// Takes the header of a file off: lines of a key and a value up to "data", between comments. octomap's own reader
/// would find other data after a header that it did not write.
bool readHeader(std::string_view& data, double& resolution) {
  bool has_resolution = false;
  for (;;) {
    const std::size_t end = data.find('\n');
    if (end == std::string_view::npos) return false;
    std::istringstream line{std::string(data.substr(0, end))};
    data.remove_prefix(end + 1);
    std::string key, id;
    if (!(line >> key) || key[0] == '#' || key == "size") continue;
    if (key == "data") return has_resolution;
    if (key == "res") {
      if (!(line >> resolution)) return false;
      has_resolution = true;
    } else if (key != "id" || !(line >> id) || id != "OcTree") {
      return false;
    }
  }
}

class Octree : public Geometry {
 public:
  explicit Octree(double resolution) : Octree(std::make_shared<octomap::OcTree>(cellSize(resolution))) {}

  std::shared_ptr<fcl::CollisionGeometryd> get() const override {
    const unsigned changing = changing_;
    if (changing != 0 && changing != forks() + 1) {
      throw std::runtime_error(
          "bocst: another thread was changing this OcTree when the process was forked, so the child cannot use it; "
          "create a new one in the child");
    }
    return Geometry::get();
  }

  void read(const std::string& data) {
    octomap::OcTree tree(tree_->getResolution());
    std::string_view nodes = data;
    double resolution = tree_->getResolution();
    std::istringstream in;
    if ((isFile(nodes) && !readHeader(nodes, resolution)) || !isBinaryOctree(nodes) ||
        (in.str(std::string(nodes)), tree.readBinaryData(in).fail())) {
      throw py::value_error("bocst: data is not an octree in octomap's binary format");
    }
    if (!(std::abs(resolution - tree_->getResolution()) <= 1e-6 * tree_->getResolution())) {
      throw py::value_error("bocst: the resolution of data is " + std::to_string(resolution) +
                            ", not r = " + std::to_string(tree_->getResolution()));
    }
    change([&] { tree_->swapContent(tree); });
  }
  void insert(const py::object& points, const py::object& origin, double maxrange, bool lazy_eval, bool discretize) {
    octomap::Pointcloud cloud;
    for (const Vector3d& p : vectors("points", points)) {
      if (!p.allFinite()) throw py::value_error("bocst: a point is not finite");
      cloud.push_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
    }
    const Vector3d o = origin.is_none() ? Vector3d::Zero().eval() : vector3("origin", origin);
    change([&] {
      tree_->insertPointCloud(
          cloud, octomap::point3d(static_cast<float>(o.x()), static_cast<float>(o.y()), static_cast<float>(o.z())),
          maxrange, lazy_eval, discretize);
    });
  }

 private:
  explicit Octree(const std::shared_ptr<octomap::OcTree>& tree)
      : Geometry(std::make_shared<fcl::OcTreed>(tree)), tree_(tree) {}

  // Once no query is reading it.
  template <typename F>
  void change(F&& f) const {
    const NoGil released;
    const std::lock_guard<FairSharedMutex> alone(octreeMutex());
    changing_ = forks() + 1;
    f();
    geometry_->computeLocalAABB();
    changing_ = 0;
  }

  std::shared_ptr<octomap::OcTree> tree_;      // what geometry_ reads
  mutable std::atomic<unsigned> changing_{0};  // forks() + 1 while it is changed
};
#endif

void bindGeometries(py::module_& m) {
  py::class_<Geometry, std::shared_ptr<Geometry>>(m, "CollisionGeometry",
                                                  "A geometry that can collide, in its own frame.")
      .def("getNodeType", [](const Geometry& g) { return g.get()->getNodeType(); })
      .def("computeLocalAABB",
           [](const Geometry& g) {
             const auto geometry = g.get();
             const NoGilWithOctrees free;
             geometry->computeLocalAABB();
           })
      .def_property(
          "aabb_center", [](const Geometry& g) { return arrayOf(g.get()->aabb_center); },
          [](const Geometry& g, const py::object& c) { g.get()->aabb_center = vector3("aabb_center", c); },
          "(3,): centre of its bounding box, in the geometry's frame.");

  ShapeClass<fcl::TrianglePd> triangle(m, "TriangleP", "A triangle of three points, (3,) each.");
  triangle.def(py::init([](const py::object& a, const py::object& b, const py::object& c) {
                 return std::make_shared<Shape<fcl::TrianglePd>>(vector3("a", a), vector3("b", b), vector3("c", c));
               }),
               "a"_a, "b"_a, "c"_a);
  const auto point = [](const char* name, const py::object& p) { return vector3(name, p); };
  constexpr const char* corner = "(3,): a corner in the geometry's frame.";
  member(triangle, "a", &fcl::TrianglePd::a, point, corner);
  member(triangle, "b", &fcl::TrianglePd::b, point, corner);
  member(triangle, "c", &fcl::TrianglePd::c, point, corner);

  ShapeClass<fcl::Boxd> box(m, "Box", "A box about the origin with these side lengths.");
  box.def(py::init([](double x, double y, double z) {
            return std::make_shared<Shape<fcl::Boxd>>(length("x", x), length("y", y), length("z", z));
          }),
          "x"_a, "y"_a, "z"_a);
  member(box, "side", &fcl::Boxd::side, lengths, "(3,): along x, y and z, in the length unit of the geometries.");

  ShapeClass<fcl::Sphered> sphere(m, "Sphere", "A sphere about the origin.");
  sphere.def(py::init([](double r) { return std::make_shared<Shape<fcl::Sphered>>(length("radius", r)); }), "radius"_a);
  member(sphere, "radius", &fcl::Sphered::radius, length, "In the length unit of the geometries.");

  ShapeClass<fcl::Ellipsoidd> ellipsoid(m, "Ellipsoid", "An ellipsoid about the origin with these radii.");
  ellipsoid.def(py::init([](double a, double b, double c) {
                  return std::make_shared<Shape<fcl::Ellipsoidd>>(length("a", a), length("b", b), length("c", c));
                }),
                "a"_a, "b"_a, "c"_a);
  member(ellipsoid, "radii", &fcl::Ellipsoidd::radii, lengths,
         "(3,): along x, y and z, in the length unit of the geometries.");

  bindRound<fcl::Capsuled>(m, "Capsule", "A cylinder of length lz along z about the origin, with round ends.");
  bindRound<fcl::Coned>(m, "Cone", "A cone of height lz along z about the origin.");
  bindRound<fcl::Cylinderd>(m, "Cylinder", "A cylinder of height lz along z about the origin.");
  bindHalf<fcl::Halfspaced>(m, "Halfspace",
                            "All x with n.x <= d. The constructor normalises n (3,) and divides d by the same length; "
                            "a new value of n is normalised, and d stays.");
  bindHalf<fcl::Planed>(m, "Plane",
                        "All x with n.x = d. The constructor normalises n (3,) and divides d by the same length; a new "
                        "value of n is normalised, and d stays.");

  ShapeClass<fcl::Convexd>(m, "Convex", R"(A convex polyhedron.

vertices: (n, 3). faces: one flat array; each face is its number of corners, then their indices.)")
      .def(py::init(&makeConvex), "vertices"_a, "num_faces"_a, "faces"_a)
      .def_property_readonly(
          "num_faces", [](const Shape<fcl::Convexd>& s) { return s.shape().getFaceCount(); }, "Number of faces.");

  bindBuilder<MakeModel>(m, "BVHModel",
                         R"(A triangle mesh: a bocst.Model with the functions of python-fcl's BVHModel.

Answers are those of FCL's BVHModel<OBBRSS>, which is called BVHModelOBBRSS here.)");
  bindBuilder<MakeObbrss>(m, "BVHModelOBBRSS", "A triangle mesh with FCL's own tree, which endModel() builds.");

#if FCL_HAVE_OCTOMAP
  py::class_<Octree, Geometry, std::shared_ptr<Octree>>(m, "OcTree", R"(An octomap with the resolution r.

data: bytes in octomap's binary format, with or without the header of a .bt file. points: (n, 3), inserted as a point
cloud seen from origin (3,). After readBinaryData() or insertPointCloud(), call computeAABB() of the objects and update()
of the managers and scenes that have this geometry.)")
      .def(py::init([](double r, const std::optional<py::bytes>& data, const py::object& points,
                       const py::object& origin, double maxrange, bool lazy_eval, bool discretize) {
             auto tree = std::make_shared<Octree>(r);
             if (data) {
               tree->read(*data);
             } else if (!points.is_none()) {
               tree->insert(points, origin, maxrange, lazy_eval, discretize);
             }
             return tree;
           }),
           "r"_a, "data"_a = py::none(), "points"_a = py::none(), "origin"_a = py::none(), "maxrange"_a = -1.0,
           "lazy_eval"_a = false, "discretize"_a = false)
      .def(
          "readBinaryData", [](Octree& o, const py::bytes& data) { o.read(data); }, "data"_a)
      .def("insertPointCloud", &Octree::insert, "points"_a, "origin"_a = py::none(), "maxrange"_a = -1.0,
           "lazy_eval"_a = false, "discretize"_a = false);
#endif
}

// Objects -------------------------------------------------------------------------------------------------------------

/// FCL's object, and the geometry as Python gave it, which contacts name.
class Object : public fcl::CollisionObjectd {
 public:
  Object(const GeometryPtr& shared, py::object of_python)
      : fcl::CollisionObjectd(shared), geometry_(shared), python_(std::move(of_python)) {}

  const GeometryPtr& shared() const { return geometry_; }
  const py::object& python() const { return python_; }
  void place(const Transform3d& X) {
    setTransform(X);
    computeAABB();
  }

 private:
  GeometryPtr geometry_;
  py::object python_;
};

/// What a query needs of an object; nobody else changes it.
struct Placed {
  explicit Placed(const Object& o) : geometry(o.shared()), X_WG(o.getTransform()) {}
  const GeometryPtr geometry;
  const Transform3d X_WG;
};

void bindObject(py::module_& m) {
  py::class_<Object>(m, "CollisionObject", "A geometry and its pose in the world.")
      .def(py::init([](const Geometry& geom, const std::optional<Transform3d>& tf) {
             auto object = std::make_unique<Object>(geom.get(), py::cast(&geom, py::return_value_policy::reference));
             object->place(tf ? *tf : Transform3d(Transform3d::Identity()));
             return object;
           }),
           "geom"_a, "tf"_a = py::none())
      .def("getObjectType", [](const Object& o) { return o.getObjectType(); })
      .def("getNodeType", [](const Object& o) { return o.getNodeType(); })
      .def(
          "collisionGeometry", [](const Object& o) { return o.python(); }, "The geometry as it was given.")
      .def("getTransform", [](const Object& o) { return Transform3d(o.getTransform()); })
      .def(
          "setTransform", [](Object& o, const Transform3d& tf) { o.place(tf); }, "tf"_a)
      .def(
          "getTranslation", [](const Object& o) { return arrayOf(Vector3d(o.getTranslation())); }, "(3,)")
      .def(
          "setTranslation",
          [](Object& o, const py::object& t) {
            o.setTranslation(translation(t));
            o.computeAABB();
          },
          "vec"_a)
      .def(
          "getRotation", [](const Object& o) { return arrayOf(Eigen::Matrix3d(o.getRotation())); }, "(3, 3)")
      .def(
          "setRotation",
          [](Object& o, const py::object& R) {
            o.setRotation(rotation(R));
            o.computeAABB();
          },
          "mat"_a)
      .def(
          "getQuatRotation", [](const Object& o) { return quaternionOf(o.getRotation()); }, "(4,): w, x, y, z")
      .def(
          "setQuatRotation",
          [](Object& o, const py::object& q) {
            o.setRotation(quaternion(q));
            o.computeAABB();
          },
          "q"_a)
      .def("computeAABB", [](Object& o) { o.computeAABB(); })
      .def("isOccupied", [](const Object& o) { return o.isOccupied(); })
      .def("isFree", [](const Object& o) { return o.isFree(); })
      .def("isUncertain", [](const Object& o) { return o.isUncertain(); })
      .def("__repr__", [](const Object& o) {
        return "CollisionObject(" + std::string(py::repr(o.python())) + ", " +
               std::string(py::repr(py::cast(Transform3d(o.getTransform())))) + ")";
      });
}

// Queries -------------------------------------------------------------------------------------------------------------

struct Contact {
  py::object o1 = py::none(), o2 = py::none();
  std::intptr_t b1 = fcl::Contactd::NONE, b2 = fcl::Contactd::NONE;
  Vector3d normal = Vector3d::Zero(), pos = Vector3d::Zero();
  double penetration_depth = 0;
};
struct CostSource {
  Vector3d aabb_min = Vector3d::Zero(), aabb_max = Vector3d::Zero();
  double cost_density = 0, total_cost = 0;
};
struct CollisionResult {
  bool is_collision = false;
  py::list contacts, cost_sources;
};
struct DistanceResult {
  double min_distance = std::numeric_limits<double>::max();
  py::object nearest_points = py::none(), o1 = py::none(), o2 = py::none();
  std::intptr_t b1 = fcl::DistanceResultd::NONE, b2 = fcl::DistanceResultd::NONE;
};
struct ContinuousResult {
  bool is_collide = false;
  double time_of_contact = 1;
};

/// The geometry of Python that one of FCL's is.
const py::object& named(const fcl::CollisionGeometryd* g, const Object& o1, const Object& o2) {
  return g == o1.shared().get() ? o1.python() : o2.python();
}

/// @throws py::value_error for a number that is none of the first `count` values, which FCL would take for one.
void checkValue(const char* name, int value, int count) {
  if (value >= 0 && value < count) return;
  throw py::value_error(std::string("bocst: ") + name + " is " + std::to_string(value) +
                        ", which is none of its values");
}

std::size_t collideObjects(const Object& o1, const Object& o2, const std::optional<fcl::CollisionRequestd>& asked,
                           CollisionResult* result) {
  const fcl::CollisionRequestd request = asked.value_or(fcl::CollisionRequestd());
  checkValue("gjk_solver_type", request.gjk_solver_type, fcl::GST_INDEP + 1);
  const Placed a(o1), b(o2);
  fcl::CollisionResultd r;
  std::size_t count;
  {
    const NoGilWithOctrees free;
    count = bocst::collide<double>(a.geometry.get(), a.X_WG, b.geometry.get(), b.X_WG, request, r);
  }
  if (result == nullptr) return count;
  result->is_collision |= r.isCollision();
  for (std::size_t i = 0; i < r.numContacts(); ++i) {
    const fcl::Contactd& c = r.getContact(i);
    result->contacts.append(
        Contact{named(c.o1, o1, o2), named(c.o2, o1, o2), c.b1, c.b2, c.normal, c.pos, c.penetration_depth});
  }
  std::vector<fcl::CostSourced> costs;
  r.getCostSources(costs);
  for (const fcl::CostSourced& c : costs) {
    result->cost_sources.append(CostSource{c.aabb_min, c.aabb_max, c.cost_density, c.total_cost});
  }
  return count;
}

/// True for a shape that is flat, a line or a point, except a TriangleP, which FCL can deal with.
bool hasNoVolume(const fcl::CollisionGeometryd& g) {
  return g.getObjectType() == fcl::OT_GEOM && g.getNodeType() != fcl::GEOM_TRIANGLE && g.computeVolume() == 0;
}

bool isRound(fcl::NODE_TYPE type) {
  return type == fcl::GEOM_SPHERE || type == fcl::GEOM_ELLIPSOID || type == fcl::GEOM_CAPSULE ||
         type == fcl::GEOM_CONE || type == fcl::GEOM_CYLINDER;
}

/// True if FCL has a formula for the distance, so that it asks no solver.
bool hasFormula(fcl::NODE_TYPE type1, fcl::NODE_TYPE type2) {
  if (type1 == fcl::GEOM_CAPSULE && type2 == fcl::GEOM_CAPSULE) return true;
  if (type2 == fcl::GEOM_SPHERE) std::swap(type1, type2);
  return type1 == fcl::GEOM_SPHERE && (type2 == fcl::GEOM_SPHERE || type2 == fcl::GEOM_BOX ||
                                       type2 == fcl::GEOM_CAPSULE || type2 == fcl::GEOM_CYLINDER);
}

/// @throws std::invalid_argument for what FCL ends the process with, or reads memory that is not there.
void refuseWhatFclLacks(const Placed& a, const Placed& b, const fcl::DistanceRequestd& request) {
  const fcl::CollisionGeometryd &g1 = *a.geometry, &g2 = *b.geometry;
  if (isModel<double>(&g1) || isModel<double>(&g2)) return;
  const auto distance = [&](bool is_signed, fcl::GJKSolverType solver) {
    fcl::DistanceRequestd plain(false, is_signed);
    plain.gjk_solver_type = solver;
    fcl::DistanceResultd r;
    bocst::distance<double>(&g1, a.X_WG, &g2, b.X_WG, plain, r);
    return r.min_distance;
  };
  const bool by_libccd = request.gjk_solver_type == fcl::GST_LIBCCD, is_signed = request.enable_signed_distance;
  const fcl::NODE_TYPE type1 = g1.getNodeType(), type2 = g2.getNodeType();
  // An assertion of libccd's simplices fails, or its polytope grows for ever, but only where they touch.
  if (by_libccd && (isRound(type1) || isRound(type2)) && (hasNoVolume(g1) || hasNoVolume(g2)) &&
      (is_signed || !hasFormula(type1, type2)) && distance(false, fcl::GST_INDEP) <= 0) {
    throw std::invalid_argument(
        "bocst: FCL has no distance by libccd of these two geometries, which touch, because one is a shape without "
        "volume; ask for GST_INDEP, or make one of them a bocst.Model");
  }
  // FCL takes the points from a contact, which it does not always find.
  const bool by_contact = !by_libccd || g1.getObjectType() != fcl::OT_GEOM || g2.getObjectType() != fcl::OT_GEOM;
  if (is_signed && request.enable_nearest_points && by_contact && distance(true, request.gjk_solver_type) < 0) {
    fcl::CollisionRequestd contact(1, true);
    contact.gjk_solver_type = request.gjk_solver_type;
    fcl::CollisionResultd r;
    if (bocst::collide<double>(&g1, a.X_WG, &g2, b.X_WG, contact, r) == 0) {
      throw std::invalid_argument(
          "bocst: FCL has no nearest points of these two geometries, because it finds a negative distance but no "
          "contact; leave out enable_nearest_points or enable_signed_distance, or make one of them a bocst.Model");
    }
  }
}

double distanceOf(const Object& o1, const Object& o2, const std::optional<fcl::DistanceRequestd>& asked,
                  DistanceResult* result) {
  const fcl::DistanceRequestd request = asked.value_or(fcl::DistanceRequestd());
  checkValue("gjk_solver_type", request.gjk_solver_type, fcl::GST_INDEP + 1);
  const Placed a(o1), b(o2);
  fcl::DistanceResultd r;
  double distance;
  {
    const NoGilWithOctrees free;
    refuseWhatFclLacks(a, b, request);
    distance = bocst::distance<double>(a.geometry.get(), a.X_WG, b.geometry.get(), b.X_WG, request, r);
  }
  if (result == nullptr || !(r.min_distance < result->min_distance)) return distance;
  result->min_distance = r.min_distance;
  // FCL sets them only where they were asked for; code for python-fcl expects two arrays.
  const Vector3d unknown = Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  py::list points;
  for (const Vector3d& p : r.nearest_points) points.append(arrayOf(request.enable_nearest_points ? p : unknown));
  result->nearest_points = points;
  result->o1 = named(r.o1, o1, o2);
  result->o2 = named(r.o2, o1, o2);
  result->b1 = r.b1;
  result->b2 = r.b2;
  return distance;
}

/// @throws for what FCL ends the process with, or reads memory that it has not set.
void refuseWhatFclLacks(const fcl::CollisionGeometryd& g1, const fcl::CollisionGeometryd& g2,
                        const fcl::ContinuousCollisionRequestd& request) {
  if (isModel<double>(&g1) || isModel<double>(&g2)) return;
  const auto is_unbounded = [](const fcl::CollisionGeometryd& g) {
    return g.getNodeType() == fcl::GEOM_PLANE || g.getNodeType() == fcl::GEOM_HALFSPACE;
  };
  const fcl::NODE_TYPE type1 = g1.getNodeType(), type2 = g2.getNodeType();
  if ((type1 == fcl::GEOM_PLANE && type2 == fcl::GEOM_CONVEX) ||
      (type1 == fcl::GEOM_CONVEX && type2 == fcl::GEOM_PLANE)) {
    throw py::value_error(
        "bocst: FCL has no continuous collision of a Plane and a Convex; make the Convex a bocst.Model");
  }
  const bool advances = request.ccd_solver_type == fcl::CCDC_CONSERVATIVE_ADVANCEMENT;
  if (advances && request.gjk_solver_type == fcl::GST_LIBCCD && !is_unbounded(g1) && !is_unbounded(g2) &&
      (hasNoVolume(g1) || hasNoVolume(g2))) {
    throw py::value_error(
        "bocst: FCL has no continuous collision of a shape without volume by conservative advancement with libccd; ask "
        "for CCDC_NAIVE or GST_INDEP, or make one of the geometries a bocst.Model");
  }
  if (request.ccd_motion_type != fcl::CCDM_SPLINE &&
      !(advances && (is_unbounded(g1) || is_unbounded(g2) ||
                     (g1.getObjectType() != fcl::OT_BVH && g2.getObjectType() == fcl::OT_BVH)))) {
    return;
  }
  throw py::value_error(
      "bocst: FCL has no continuous collision of these two geometries with this solver and motion; make one of them a "
      "bocst.Model, or ask for CCDC_NAIVE and CCDM_LINEAR");
}

double continuousOf(const Object& o1, const Transform3d& X_W1_end, const Object& o2, const Transform3d& X_W2_end,
                    const std::optional<fcl::ContinuousCollisionRequestd>& asked, ContinuousResult* result) {
  const fcl::ContinuousCollisionRequestd request = asked.value_or(fcl::ContinuousCollisionRequestd());
  checkValue("ccd_motion_type", request.ccd_motion_type, fcl::CCDM_SPLINE + 1);
  checkValue("ccd_solver_type", request.ccd_solver_type, fcl::CCDC_POLYNOMIAL_SOLVER + 1);
  checkValue("gjk_solver_type", request.gjk_solver_type, fcl::GST_INDEP + 1);
  const Placed a(o1), b(o2);
  refuseWhatFclLacks(*a.geometry, *b.geometry, request);
  fcl::ContinuousCollisionResultd r;
  double time;
  {
    const NoGilWithOctrees free;
    time = bocst::continuousCollide<double>(a.geometry.get(), a.X_WG, X_W1_end, b.geometry.get(), b.X_WG, X_W2_end,
                                            request, r);
  }
  if (result != nullptr) {
    result->is_collide |= r.is_collide;
    result->time_of_contact = std::min(result->time_of_contact, r.time_of_contact);
  }
  return time;
}

template <typename C, typename Struct>
void vectorMember(py::class_<C>& c, const char* name, Vector3d Struct::*at, const char* text) {
  c.def_property(
      name, [at](const C& s) { return arrayOf(Vector3d(s.*at)); },
      [name, at](C& s, const py::object& v) { s.*at = vector3(name, v); }, text);
}

/// Ints are taken for them, as python-fcl has them.
template <typename E>
py::enum_<E> bindEnum(py::module_& m, const char* name, const char* text) {
  return py::enum_<E>(m, name, py::arithmetic(), text);
}

void bindEnums(py::module_& m) {
  bindEnum<fcl::NODE_TYPE>(m, "NODE_TYPE", "Type of a geometry.")
      .value("BV_UNKNOWN", fcl::BV_UNKNOWN)
      .value("BV_AABB", fcl::BV_AABB)
      .value("BV_OBB", fcl::BV_OBB)
      .value("BV_RSS", fcl::BV_RSS)
      .value("BV_kIOS", fcl::BV_kIOS)
      .value("BV_OBBRSS", fcl::BV_OBBRSS)
      .value("BV_KDOP16", fcl::BV_KDOP16)
      .value("BV_KDOP18", fcl::BV_KDOP18)
      .value("BV_KDOP24", fcl::BV_KDOP24)
      .value("GEOM_BOX", fcl::GEOM_BOX)
      .value("GEOM_SPHERE", fcl::GEOM_SPHERE)
      .value("GEOM_ELLIPSOID", fcl::GEOM_ELLIPSOID)
      .value("GEOM_CAPSULE", fcl::GEOM_CAPSULE)
      .value("GEOM_CONE", fcl::GEOM_CONE)
      .value("GEOM_CYLINDER", fcl::GEOM_CYLINDER)
      .value("GEOM_CONVEX", fcl::GEOM_CONVEX)
      .value("GEOM_PLANE", fcl::GEOM_PLANE)
      .value("GEOM_HALFSPACE", fcl::GEOM_HALFSPACE)
      .value("GEOM_TRIANGLE", fcl::GEOM_TRIANGLE)
      .value("GEOM_OCTREE", fcl::GEOM_OCTREE);
  bindEnum<fcl::OBJECT_TYPE>(m, "OBJECT_TYPE", "Kind of a geometry: mesh, shape or octree.")
      .value("OT_UNKNOWN", fcl::OT_UNKNOWN)
      .value("OT_BVH", fcl::OT_BVH)
      .value("OT_GEOM", fcl::OT_GEOM)
      .value("OT_OCTREE", fcl::OT_OCTREE);
  bindEnum<fcl::GJKSolverType>(m, "GJKSolverType", "Solver for convex shapes: libccd, or FCL's own.")
      .value("GST_LIBCCD", fcl::GST_LIBCCD)
      .value("GST_INDEP", fcl::GST_INDEP);
  bindEnum<fcl::CCDMotionType>(m, "CCDMotionType", "How an object moves between two poses in continuousCollide().")
      .value("CCDM_TRANS", fcl::CCDM_TRANS)
      .value("CCDM_LINEAR", fcl::CCDM_LINEAR)
      .value("CCDM_SCREW", fcl::CCDM_SCREW)
      .value("CCDM_SPLINE", fcl::CCDM_SPLINE);
  bindEnum<fcl::CCDSolverType>(m, "CCDSolverType", "How continuousCollide() finds the time of contact.")
      .value("CCDC_NAIVE", fcl::CCDC_NAIVE)
      .value("CCDC_CONSERVATIVE_ADVANCEMENT", fcl::CCDC_CONSERVATIVE_ADVANCEMENT)
      .value("CCDC_RAY_SHOOTING", fcl::CCDC_RAY_SHOOTING)
      .value("CCDC_POLYNOMIAL_SOLVER", fcl::CCDC_POLYNOMIAL_SOLVER);
  py::implicitly_convertible<int, fcl::GJKSolverType>();
  py::implicitly_convertible<int, fcl::CCDMotionType>();
  py::implicitly_convertible<int, fcl::CCDSolverType>();
}

void bindCollide(py::module_& m) {
  using Request = fcl::CollisionRequestd;
  py::class_<Request>(
      m, "CollisionRequest",
      "The request of collide(). Without enable_contact, contacts only name the geometries and primitives that touch.")
      .def(py::init<std::size_t, bool, std::size_t, bool, bool, fcl::GJKSolverType>(), "num_max_contacts"_a = 1,
           "enable_contact"_a = false, "num_max_cost_sources"_a = 1, "enable_cost"_a = false,
           "use_approximate_cost"_a = true, "gjk_solver_type"_a = fcl::GST_LIBCCD)
      .def_readwrite("num_max_contacts", &Request::num_max_contacts, "Contacts that a call returns at most.")
      .def_readwrite("enable_contact", &Request::enable_contact, "True: contacts have positions, normals and depths.")
      .def_readwrite("num_max_cost_sources", &Request::num_max_cost_sources,
                     "Cost sources that a call returns at most.")
      .def_readwrite("enable_cost", &Request::enable_cost, "True: cost sources are computed.")
      .def_readwrite("use_approximate_cost", &Request::use_approximate_cost, "True: FCL may approximate cost sources.")
      .def_readwrite("gjk_solver_type", &Request::gjk_solver_type, "Solver for convex shapes.")
      .def_readwrite("gjk_tolerance", &Request::gjk_tolerance, "Tolerance of that solver.");

  py::class_<Contact> contact(m, "Contact", "Two primitives that touch.");
  contact.def(py::init<>())
      .def_readwrite("o1", &Contact::o1, "The first geometry, as it was given.")
      .def_readwrite("o2", &Contact::o2, "The second geometry, as it was given.")
      .def_readwrite("b1", &Contact::b1, "Index of the triangle or cell of o1; -1 for a shape.")
      .def_readwrite("b2", &Contact::b2, "Index of the triangle or cell of o2; -1 for a shape.")
      .def_readwrite("penetration_depth", &Contact::penetration_depth,
                     "At least 0, in the length unit of the geometries; NaN without enable_contact.");
  vectorMember(contact, "normal", &Contact::normal,
               "(3,): unit vector from o1 to o2, in the world frame; NaN without enable_contact.");
  vectorMember(contact, "pos", &Contact::pos, "(3,): position in the world frame; NaN without enable_contact.");

  py::class_<CostSource> cost(m, "CostSource", "A box in which two geometries overlap, in the world frame.");
  cost.def(py::init<>())
      .def_readwrite("cost_density", &CostSource::cost_density, "Cost per volume.")
      .def_readwrite("total_cost", &CostSource::total_cost, "cost_density times the volume of the box.");
  vectorMember(cost, "aabb_min", &CostSource::aabb_min, "(3,): minimum corner of the box, in the world frame.");
  vectorMember(cost, "aabb_max", &CostSource::aabb_max, "(3,): maximum corner of the box, in the world frame.");

  py::class_<CollisionResult>(m, "CollisionResult", "The result of collide(); each call adds to it.")
      .def(py::init([](const py::object& contacts, const py::object& costs) {
             CollisionResult r;
             if (!contacts.is_none()) r.contacts = py::list(contacts);
             if (!costs.is_none()) r.cost_sources = py::list(costs);
             return r;
           }),
           "contacts"_a = py::none(), "cost_sources"_a = py::none())
      .def_readwrite("is_collision", &CollisionResult::is_collision, "True if any call found a contact.")
      .def_readwrite("contacts", &CollisionResult::contacts, "List of the Contacts of all calls.")
      .def_readwrite("cost_sources", &CollisionResult::cost_sources, "List of the CostSources of all calls.")
      .def("__repr__", [](const CollisionResult& r) {
        return std::string("CollisionResult(") + (r.is_collision ? "collision, " : "no collision, ") +
               counted(r.contacts.size(), "contact") + ", " + counted(r.cost_sources.size(), "cost source") + ")";
      });
  m.def("collide", &collideObjects, "o1"_a, "o2"_a, "request"_a = py::none(), "result"_a = py::none(),
        R"(Checks two objects for collision.

Returns the number of contacts of this call, at most request.num_max_contacts, and adds them to the result.)");
}

void bindDistance(py::module_& m) {
  using Request = fcl::DistanceRequestd;
  py::class_<Request>(m, "DistanceRequest", "The request of distance().")
      .def(py::init([](bool nearest, bool with_sign, fcl::GJKSolverType solver) {
             Request r(nearest, with_sign);
             r.gjk_solver_type = solver;
             return r;
           }),
           "enable_nearest_points"_a = false, "enable_signed_distance"_a = false, "gjk_solver_type"_a = fcl::GST_LIBCCD)
      .def_readwrite("enable_nearest_points", &Request::enable_nearest_points,
                     "True: the result has the nearest points.")
      .def_readwrite(
          "enable_signed_distance", &Request::enable_signed_distance,
          "True: the distance of shapes that overlap is minus their penetration depth, where FCL computes it.")
      .def_readwrite("rel_err", &Request::rel_err, "Relative error that is allowed, from 0 to 1.")
      .def_readwrite("abs_err", &Request::abs_err, "Error that is allowed, in the length unit of the geometries.")
      .def_readwrite("gjk_solver_type", &Request::gjk_solver_type, "Solver for convex shapes.");
  py::class_<DistanceResult>(m, "DistanceResult", "The minimum distance over all calls of distance() with this result.")
      .def(py::init([](const std::optional<double>& least) {
             DistanceResult r;
             if (least) r.min_distance = *least;
             return r;
           }),
           "min_distance_"_a = py::none())
      .def_readwrite(
          "min_distance", &DistanceResult::min_distance,
          "Minimum of all calls, in the length unit of the geometries; the largest float before the first call.")
      .def_readwrite("nearest_points", &DistanceResult::nearest_points,
                     "List of two points (3,), on o1 and on o2, in the world frame; None before a request enables it.")
      .def_readwrite("o1", &DistanceResult::o1, "The first geometry of the nearest pair, as it was given.")
      .def_readwrite("o2", &DistanceResult::o2, "The second geometry of the nearest pair, as it was given.")
      .def_readwrite("b1", &DistanceResult::b1, "Index of the triangle or cell of o1; -1 for a shape.")
      .def_readwrite("b2", &DistanceResult::b2, "Index of the triangle or cell of o2; -1 for a shape.");
  m.def("distance", &distanceOf, "o1"_a, "o2"_a, "request"_a = py::none(), "result"_a = py::none(),
        R"(Computes the distance between two objects.

Returns the distance of this pair, in the length unit of the geometries; the result keeps the minimum of all calls.)");
}

void bindContinuousCollide(py::module_& m) {
  using Request = fcl::ContinuousCollisionRequestd;
  py::class_<Request>(m, "ContinuousCollisionRequest", "The request of continuousCollide().")
      .def(py::init<std::size_t, double, fcl::CCDMotionType, fcl::GJKSolverType, fcl::CCDSolverType>(),
           "num_max_iterations"_a = 10, "toc_err"_a = 0.0001, "ccd_motion_type"_a = fcl::CCDM_TRANS,
           "gjk_solver_type"_a = fcl::GST_LIBCCD, "ccd_solver_type"_a = fcl::CCDC_NAIVE)
      .def_readwrite("num_max_iterations", &Request::num_max_iterations, "Steps that FCL makes at most.")
      .def_readwrite("toc_err", &Request::toc_err,
                     "Error of the time of contact that is allowed; the whole motion takes the time 1.")
      .def_readwrite("ccd_motion_type", &Request::ccd_motion_type, "How objects move between their poses.")
      .def_readwrite("gjk_solver_type", &Request::gjk_solver_type, "Solver for convex shapes.")
      .def_readwrite("ccd_solver_type", &Request::ccd_solver_type, "How the time of contact is found.");
  py::class_<ContinuousResult>(m, "ContinuousCollisionResult",
                               "The result of continuousCollide(); each call adds to it.")
      .def(py::init([](bool is_collide, double time) {
             return ContinuousResult{is_collide, time};
           }),
           "is_collide"_a = false, "time_of_contact"_a = 1.0)
      .def_readwrite("is_collide", &ContinuousResult::is_collide, "True if any call found contact.")
      .def_readwrite("time_of_contact", &ContinuousResult::time_of_contact,
                     "Earliest time of all calls, from 0 to 1; 1 without contact.");
  m.def("continuousCollide", &continuousOf, "o1"_a, "tf1_end"_a, "o2"_a, "tf2_end"_a, "request"_a = py::none(),
        "result"_a = py::none(),
        R"(Computes when two objects first touch, on the motion from their current poses to tf1_end and tf2_end.

Returns the time from 0 to 1; 1 if they do not touch.)");
}

// Managers ------------------------------------------------------------------------------------------------------------

/// A callback of Python. Whatever it throws ends the query and is thrown again when FCL is done.
struct Callback {
  const py::object& data;
  const py::object& function;
  std::exception_ptr failure = nullptr;

  static bool collide(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* self) {
    return static_cast<Callback*>(self)->stops(o1, o2, &isTrue);
  }
  static bool distance(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, void* self, double& least) {
    return static_cast<Callback*>(self)->stops(o1, o2, [&least](const py::object& returned) {
      const auto pair = py::reinterpret_steal<py::tuple>(pauseAtExit([&] { return PySequence_Tuple(returned.ptr()); }));
      if (!pair) throw py::error_already_set();
      if (pair.size() != 2) {
        throw py::type_error("bocst: a callback of distance must return (done, distance), not " +
                             py::repr(returned).cast<std::string>());
      }
      const double distance = pauseAtExit([&] { return PyFloat_AsDouble(PyTuple_GET_ITEM(pair.ptr(), 1)); });
      if (PyErr_Occurred() != nullptr) throw py::error_already_set();
      least = distance;
      return isTrue(pair[0]);
    });
  }

 private:
  static bool isTrue(const py::object& o) {
    const int truth = pauseAtExit([&o] { return PyObject_IsTrue(o.ptr()); });
    if (truth < 0) throw py::error_already_set();
    return truth != 0;
  }
  template <typename Read>
  bool stops(fcl::CollisionObjectd* o1, fcl::CollisionObjectd* o2, const Read& read) {
    try {
      const py::object a = py::cast(static_cast<Object*>(o1), py::return_value_policy::reference);
      const py::object b = py::cast(static_cast<Object*>(o2), py::return_value_policy::reference);
      const auto returned = py::reinterpret_steal<py::object>(pauseAtExit(
          [&] { return PyObject_CallFunctionObjArgs(function.ptr(), a.ptr(), b.ptr(), data.ptr(), nullptr); }));
      if (!returned) throw py::error_already_set();
      return read(returned);
    } catch (...) {
      failure = std::current_exception();
      return true;
    }
  }
};

class Manager {
 public:
  // Else FCL calls back with an object of its own for each cell, which Python does not know.
  Manager() { manager_.octree_as_geometry_collide = manager_.octree_as_geometry_distance = true; }

  void add(Object& object) {
    change();
    const py::object o = named(object);
    if (objects_.contains(keyOf(o))) throw py::value_error("bocst: the object is registered already");
    objects_[keyOf(o)] = o;
    manager_.registerObject(&object);
  }
  void addAll(const py::iterable& objects) {
    std::vector<py::object> held;
    py::dict keys;
    for (const py::handle o : objects) {
      if (!py::isinstance<Object>(o))
        throw py::type_error("bocst: " + py::repr(o).cast<std::string>() + " is not a CollisionObject");
      held.push_back(py::reinterpret_borrow<py::object>(o));
      const py::int_ key = keyOf(o);
      if (objects_.contains(key)) throw py::value_error("bocst: an object is registered already");
      if (keys.contains(key)) throw py::value_error("bocst: an object is given twice");
      keys[key] = py::none();
    }
    for (const py::object& o : held) add(o.cast<Object&>());
  }
  // Ignores whatever else it is given, as python-fcl does.
  void remove(const py::object& object) {
    change();
    const py::int_ key = keyOf(object);
    if (!objects_.contains(key)) return;
    manager_.unregisterObject(object.cast<Object*>());
    objects_.attr("pop")(key);
  }
  void clear() {
    change();
    manager_.clear();
    objects_.clear();
  }
  void setup() {
    change();
    manager_.setup();
  }
  void update(const py::object& what) {
    std::vector<py::object> given;
    const auto add = [&](const py::handle& o) {
      if (!py::isinstance<Object>(o)) {
        throw py::type_error("bocst: " + py::repr(o).cast<std::string>() + " is not a CollisionObject");
      }
      given.push_back(py::reinterpret_borrow<py::object>(o));
    };
    if (py::isinstance<Object>(what)) {
      add(what);
    } else if (!what.is_none()) {
      for (const auto& o : what) add(o);
    }
    // Only now: the caller's iterator may have let other threads start a query, or unregister objects.
    change();
    if (what.is_none()) return manager_.update();
    std::vector<fcl::CollisionObjectd*> all;
    for (const py::object& o : given) {
      if (objects_.contains(keyOf(o))) all.push_back(o.cast<Object*>());
    }
    manager_.update(all);
  }

  // The GIL is held: callbacks are Python's. What they ask lets go of it.
  template <typename... With>
  void collide(const py::object& data, const py::object& callback, With*... with) const {
    Callback c{data, callback};
    const Asked asked(*this);
    manager_.collide(with..., &c, &Callback::collide);
    if (c.failure) std::rethrow_exception(c.failure);
  }
  template <typename... With>
  void distance(const py::object& data, const py::object& callback, With*... with) const {
    Callback c{data, callback};
    const Asked asked(*this);
    manager_.distance(with..., &c, &Callback::distance);
    if (c.failure) std::rethrow_exception(c.failure);
  }
  void collideWith(Manager& other, const py::object& data, const py::object& callback) const {
    const Asked asked(other);
    collide(data, callback, &other.manager_);
  }
  void distanceTo(Manager& other, const py::object& data, const py::object& callback) const {
    const Asked asked(other);
    distance(data, callback, &other.manager_);
  }

  py::list objects() const { return py::list(objects_.attr("values")()); }
  fcl::DynamicAABBTreeCollisionManagerd& fcl() { return manager_; }

 private:
  /// While a callback runs, another thread may come by.
  struct Asked {
    explicit Asked(const Manager& m) : manager(m) { ++manager.asked_; }
    ~Asked() { --manager.asked_; }
    const Manager& manager;
  };
  void change() const {
    if (asked_ > 0) throw std::runtime_error("bocst: the manager cannot be changed during a query");
  }
  static py::object named(Object& o) { return py::cast(&o, py::return_value_policy::reference); }
  // Not the object itself: its class may say that another is equal to it.
  static py::int_ keyOf(const py::handle& object) { return py::int_(reinterpret_cast<std::uintptr_t>(object.ptr())); }

  py::dict objects_;  // by keyOf(), in the order of registering; they outlive what FCL knows of them
  fcl::DynamicAABBTreeCollisionManagerd manager_;
  mutable int asked_ = 0;
};

void bindManager(py::module_& m) {
  auto c = py::class_<Manager>(m, "DynamicAABBTreeCollisionManager", R"(FCL's manager of many objects.

collide(data, callback): all pairs of its objects; collide(object, data, callback): the object with each of its objects;
collide(manager, data, callback): each object of this manager with each of the other. callback(o1, o2, data) returns True
to stop. distance: the same, with callbacks that return (done, minimum distance so far).)")
               .def(py::init<>())
               .def("registerObject", &Manager::add, "obj"_a)
               .def("registerObjects", &Manager::addAll, "other_objs"_a)
               .def("unregisterObject", &Manager::remove, "obj"_a)
               .def("setup", &Manager::setup)
               .def("update", &Manager::update, "arg"_a = py::none(),
                    "Call this after one object, several objects or all objects were moved. Objects that are not "
                    "registered are ignored, as by python-fcl.")
               .def("getObjects", &Manager::objects)
               .def("clear", &Manager::clear)
               .def("empty", [](const Manager& s) { return s.objects().empty(); })
               .def("size", [](const Manager& s) { return s.objects().size(); })
               .def("__repr__",
                    [](const Manager& s) {
                      return "DynamicAABBTreeCollisionManager(" + counted(s.objects().size(), "object") + ")";
                    })
               .def("collide", &Manager::collideWith, "other_manager"_a, "cdata"_a, "callback"_a)
               .def(
                   "collide",
                   [](const Manager& s, Object& o, const py::object& d, const py::object& f) { s.collide(d, f, &o); },
                   "obj"_a, "cdata"_a, "callback"_a)
               .def(
                   "collide", [](const Manager& s, const py::object& d, const py::object& f) { s.collide(d, f); },
                   "cdata"_a, "callback"_a)
               .def("distance", &Manager::distanceTo, "other_manager"_a, "cdata"_a, "callback"_a)
               .def(
                   "distance",
                   [](const Manager& s, Object& o, const py::object& d, const py::object& f) { s.distance(d, f, &o); },
                   "obj"_a, "cdata"_a, "callback"_a)
               .def(
                   "distance", [](const Manager& s, const py::object& d, const py::object& f) { s.distance(d, f); },
                   "cdata"_a, "callback"_a);
  using Fcl = fcl::DynamicAABBTreeCollisionManagerd;
  const auto option = [&c](const char* name, auto at, const char* text) {
    using Value = std::remove_reference_t<decltype(at(std::declval<Fcl&>()))>;
    c.def_property(
        name, [at](Manager& s) { return at(s.fcl()); }, [at](Manager& s, Value value) { at(s.fcl()) = value; }, text);
  };
  option(
      "max_tree_nonbalanced_level", [](Fcl& f) -> int& { return f.max_tree_nonbalanced_level; },
      "Levels above the balanced height at which setup() and update() rebuild the tree.");
  option(
      "tree_incremental_balance_pass", [](Fcl& f) -> int& { return f.tree_incremental_balance_pass; },
      "Passes with which they balance a tree that is not so high.");
  option(
      "tree_topdown_balance_threshold", [](Fcl& f) -> int& { return f.tree_topdown_balance_threshold; },
      "Number of objects up to which a part of the tree is built from the bottom.");
  option(
      "tree_topdown_level", [](Fcl& f) -> int& { return f.tree_topdown_level; },
      "How larger parts are split, from the top: 0: at the median; 1: at the mean.");
  option(
      "tree_init_level", [](Fcl& f) -> int& { return f.tree_init_level; },
      "How the tree is built from many objects: 0 to 3 as in FCL.");
  for (const char* name : {"octree_as_geometry_collide", "octree_as_geometry_distance"}) {
    c.def_property(
        name, [](const Manager&) { return true; },
        [name](Manager&, bool value) {
          if (!value) throw py::value_error(std::string("bocst: ") + name + " can only be True");
        },
        "Always True: callbacks get an OcTree as one object.");
  }
}

}  // namespace

unsigned forks() {
  static std::atomic<unsigned> count{0};
  [[maybe_unused]] static const int registered = pthread_atfork(nullptr, nullptr, [] { count.fetch_add(1); });
  return count;
}

FairSharedMutex& octreeMutex() {
  static FairSharedMutex mutex;
  return mutex;
}

std::shared_ptr<Modeld> makeModel(std::shared_ptr<const Mesh> mesh, const Options& options) {
  const UncheckedDispatch in_any_order;
  return std::make_shared<Modeld>(std::move(mesh), options);
}

void bindFcl(py::module_ m) {
  m.doc() = "FCL's queries under python-fcl's names.";
  bindTransform(m);
  bindGeometries(m);
  bindObject(m);
  bindEnums(m);
  bindCollide(m);
  bindDistance(m);
  bindContinuousCollide(m);
  bindManager(m);
}

}  // namespace bocst::python
