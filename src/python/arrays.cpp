// SPDX-License-Identifier: BSD-3-Clause
#include "python/arrays.h"

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "python/geometry.h"

namespace bocst::python {
namespace {

[[noreturn]] void refuse(const char* name, const std::string& what) {
  throw py::value_error(std::string("bocst: ") + name + " " + what);
}

std::string shapeText(const py::array& a) { return py::str(a.attr("shape")); }

/// The object as an array of numbers whose dtype has one of these kinds.
py::array numbers(const char* name, const py::handle& object, const char* kinds, const char* expected) {
  // An array of values that may be missing: NumPy would drop the mask.
  if (py::hasattr(object, "mask") && py::isinstance(object, py::module_::import("numpy.ma").attr("MaskedArray"))) {
    throw py::type_error(std::string("bocst: ") + name +
                         " is a masked array; pass its filled() or compressed() values");
  }
  const py::array a = py::array::ensure(object);
  if (!a || std::strchr(kinds, a.dtype().kind()) == nullptr) {
    PyErr_Clear();
    const std::string got = a ? "dtype " + std::string(py::str(a.dtype())) : std::string(py::str(py::type::of(object)));
    throw py::type_error(std::string("bocst: ") + name + " must be an array of " + expected + ", not " + got);
  }
  return a;
}

void checkFinite(const char* name, const double* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) {
    if (!std::isfinite(values[i])) refuse(name, "has the value " + std::to_string(values[i]) + ", which is not finite");
  }
}

}  // namespace

py::array_t<double, py::array::c_style> doubles(const char* name, const py::handle& object) {
  return py::array_t<double, py::array::c_style | py::array::forcecast |
                                 py::detail::npy_api::NPY_ARRAY_ALIGNED_>::ensure(numbers(name, object, "fiu",
                                                                                          "real numbers"));
}

std::vector<Eigen::Vector3d> vectors(const char* name, const py::handle& object) {
  const py::array a = numbers(name, object, "fiu", "real numbers");
  if (a.ndim() != 2 || a.shape(1) != 3) refuse(name, "has the shape " + shapeText(a) + "; (n, 3) is expected");
  std::vector<Eigen::Vector3d> result(static_cast<std::size_t>(a.shape(0)));
  // NumPy converts and copies, whatever the dtype and the strides, straight to where the vectors are.
  const py::array_t<double> to({a.shape(0), py::ssize_t{3}}, reinterpret_cast<double*>(result.data()), py::none());
  const py::object copyto = py::module_::import("numpy").attr("copyto");
  const auto done = py::reinterpret_steal<py::object>(
      pauseAtExit([&] { return PyObject_CallFunctionObjArgs(copyto.ptr(), to.ptr(), a.ptr(), nullptr); }));
  if (!done) throw py::error_already_set();
  return result;
}

std::vector<std::array<std::uint32_t, 3>> indices(const char* name, const py::handle& object) {
  const py::array a = numbers(name, object, "iu", "integers");
  if (a.ndim() != 2 || a.shape(1) != 3) refuse(name, "has the shape " + shapeText(a) + "; (n, 3) is expected");
  const auto wide = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>::ensure(a);
  const std::int64_t* from = wide.data();
  const bool is_unsigned = a.dtype().kind() == 'u';  // from 2^63 on they are negative in `wide`
  std::vector<std::array<std::uint32_t, 3>> result(static_cast<std::size_t>(a.shape(0)));
  for (std::size_t t = 0; t < result.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::int64_t i = from[3 * t + k];
      if (i < 0 || i > 0xffffffff) {
        const std::string index = is_unsigned ? std::to_string(static_cast<std::uint64_t>(i)) : std::to_string(i);
        refuse(name, "has the index " + index + " in row " + std::to_string(t) + ", which no vertex has");
      }
      result[t][k] = static_cast<std::uint32_t>(i);
    }
  }
  return result;
}

Eigen::Vector3d vector3(const char* name, const py::handle& object) {
  const auto a = doubles(name, object);
  if (a.ndim() != 1 || a.shape(0) != 3) refuse(name, "has the shape " + shapeText(a) + "; (3,) is expected");
  checkFinite(name, a.data(), 3);
  return Eigen::Vector3d(a.data());
}

Eigen::Matrix3d matrix3(const char* name, const py::handle& object) {
  const auto a = doubles(name, object);
  if (a.ndim() != 2 || a.shape(0) != 3 || a.shape(1) != 3) {
    refuse(name, "has the shape " + shapeText(a) + "; (3, 3) is expected");
  }
  checkFinite(name, a.data(), 9);
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(a.data());
}

Poses::Poses(const char* name, const py::handle& object) : name_(name) {
  array_ = numbers(name, object, "fiu", "real numbers");
  const py::ssize_t n = array_.ndim();
  if (n < 2 || array_.shape(n - 1) != 4 || array_.shape(n - 2) != 4) {
    refuse(name, "has the shape " + shapeText(array_) + "; (..., 4, 4) is expected");
  }
  shape_.assign(array_.shape(), array_.shape() + n - 2);
  for (const py::ssize_t s : shape_) count_ *= static_cast<std::size_t>(s);
  // What np.swapaxes(X, -1, -2) of an array in C order looks like.
  const py::array turned = array_.attr("swapaxes")(n - 2, n - 1);
  constexpr int kInPlace = py::array::c_style | py::detail::npy_api::NPY_ARRAY_ALIGNED_;
  if (array_.dtype().is(py::dtype::of<double>()) && (turned.flags() & kInPlace) == kInPlace) {
    order_ = MatrixOrder::kColumns;
  } else {
    array_ = doubles(name, array_);
  }
  data_ = static_cast<const double*>(array_.data());
}

std::string Poses::indexText(std::size_t k) const {
  std::string text;
  for (auto n = shape_.rbegin(); n != shape_.rend(); ++n) {
    text = std::to_string(k % static_cast<std::size_t>(*n)) + (text.empty() ? "" : ", ") + text;
    k /= static_cast<std::size_t>(*n);
  }
  return text.empty() ? text : "[" + text + "]";
}

const fcl::Transform3d* Poses::transforms(std::vector<fcl::Transform3d>& copy) const {
  const bool columns = order_ == MatrixOrder::kColumns;
  // The last row of a matrix starts at the last number of the first column, or of the third row.
  const std::size_t first = columns ? 3 : 12, step = columns ? 4 : 1;
  for (std::size_t k = 0; k < count_; ++k) {
    const double* m = data_ + 16 * k + first;
    if ((m[0] == 0) & (m[step] == 0) & (m[2 * step] == 0) & (m[3 * step] == 1)) continue;
    std::ostringstream text;
    text.precision(std::numeric_limits<double>::max_digits10);
    text << "bocst: " << name_ << indexText(k) << " has the last row " << m[0] << " " << m[step] << " " << m[2 * step]
         << " " << m[3 * step] << "; 0 0 0 1 is expected";
    throw std::invalid_argument(text.str());
  }
  if (columns && reinterpret_cast<std::uintptr_t>(data_) % alignof(fcl::Transform3d) == 0) {
    return reinterpret_cast<const fcl::Transform3d*>(data_);
  }
  using Rows = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>;
  copy.resize(count_);
  for (std::size_t k = 0; k < count_; ++k) {
    const double* m = data_ + 16 * k;
    copy[k].matrix() = columns ? Eigen::Matrix4d(Eigen::Map<const Eigen::Matrix4d>(m)) : Eigen::Matrix4d(Rows(m));
  }
  return copy.data();
}

fcl::Transform3d pose(const char* name, const py::handle& object) {
  const Poses poses(name, object);
  if (!poses.shape().empty())
    refuse(name, "has the shape " + shapeText(py::array::ensure(object)) + "; (4, 4) is expected");
  std::vector<fcl::Transform3d> copy;
  return *poses.transforms(copy);
}

std::string counted(std::size_t count, const char* one, const char* many) {
  return std::to_string(count) + " " + (count == 1 ? one : many != nullptr ? many : std::string(one) + "s");
}

py::array_t<double> arrayOf(const Eigen::Vector3d& v) { return py::array_t<double>(3, v.data()); }

py::array_t<double> arrayOf(const Eigen::Matrix3d& m) {
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rows = m;
  return py::array_t<double>({3, 3}, rows.data());
}

}  // namespace bocst::python
