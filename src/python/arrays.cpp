// SPDX-License-Identifier: BSD-3-Clause
#include "python/arrays.h"

#include <algorithm>
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
  const auto wrong = [&](const std::string& got) {
    return std::string("bocst: ") + name + " must be an array of " + expected + ", not " + got;
  };
  py::array a;
  try {
    a = py::module_::import("numpy").attr("asarray")(object);
  } catch (py::error_already_set& e) {  // NumPy or the object's __array__ says why
    py::raise_from(e, PyExc_TypeError, wrong(py::str(py::type::of(object))).c_str());
    throw py::error_already_set();
  }
  if (std::strchr(kinds, a.dtype().kind()) == nullptr) {
    throw py::type_error(wrong("dtype " + std::string(py::str(a.dtype()))));
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
  const bool is_double = array_.dtype().is(py::dtype::of<double>());
  is_float_ = array_.dtype().is(py::dtype::of<float>());
  if (!(is_double || is_float_) || shape_.size() > 2) array_ = doubles(name, array_), is_float_ = false;
  data_ = static_cast<const char*>(array_.data());
  row_ = array_.strides(n - 2);
  column_ = array_.strides(n - 1);
  if (shape_.size() > 2) {
    outer_ = kBytes;
  } else if (!shape_.empty()) {
    outer_ = array_.strides(0);
  }
  if (shape_.size() == 2) {
    inner_ = array_.strides(1);
    inner_count_ = std::max<std::size_t>(1, static_cast<std::size_t>(shape_[1]));
  }
  bool is_compact = !is_float_ && reinterpret_cast<std::uintptr_t>(data_) % alignof(double) == 0;
  py::ssize_t stride = kBytes;
  for (py::ssize_t d = n - 3; d >= 0; --d) {
    is_compact &= array_.shape(d) == 1 || array_.strides(d) == stride;
    stride *= array_.shape(d);
  }
  if (is_compact && row_ == 32 && column_ == 8) order_ = MatrixOrder::kRows;
  if (is_compact && row_ == 8 && column_ == 32) order_ = MatrixOrder::kColumns;
}

std::string Poses::indexText(std::size_t k) const {
  std::string text;
  for (auto n = shape_.rbegin(); n != shape_.rend(); ++n) {
    text = std::to_string(k % static_cast<std::size_t>(*n)) + (text.empty() ? "" : ", ") + text;
    k /= static_cast<std::size_t>(*n);
  }
  return text.empty() ? text : "[" + text + "]";
}

namespace {

template <typename Number>
Eigen::Matrix4d matrixAt(const char* at, py::ssize_t row, py::ssize_t column) {
  Eigen::Matrix4d m;
  for (int c = 0; c < 4; ++c) {
    for (int r = 0; r < 4; ++r) {
      Number x;
      std::memcpy(&x, at + r * row + c * column, sizeof(x));
      m(r, c) = static_cast<double>(x);
    }
  }
  return m;
}

}  // namespace

Eigen::Matrix4d Poses::matrix(std::size_t k) const {
  const char* const at =
      data_ + static_cast<py::ssize_t>(k / inner_count_) * outer_ + static_cast<py::ssize_t>(k % inner_count_) * inner_;
  if (is_float_) return matrixAt<float>(at, row_, column_);
  if (row_ == 32 && column_ == 8) return matrixAt<double>(at, 32, 8);
  return matrixAt<double>(at, row_, column_);
}

const fcl::Transform3d* Poses::transforms(std::size_t begin, std::size_t end,
                                          std::vector<fcl::Transform3d>& copy) const {
  const auto check = [&](std::size_t k, double x, double y, double z, double w) {
    if ((x == 0) & (y == 0) & (z == 0) & (w == 1)) return;
    std::ostringstream text;
    text.precision(std::numeric_limits<double>::max_digits10);
    text << "bocst: " << name_ << indexText(k) << " has the last row " << x << " " << y << " " << z << " " << w
         << "; 0 0 0 1 is expected";
    throw std::invalid_argument(text.str());
  };
  if (order_ == MatrixOrder::kColumns && reinterpret_cast<std::uintptr_t>(data_) % alignof(fcl::Transform3d) == 0) {
    const double* const all = data();
    for (std::size_t k = begin; k < end; ++k) {
      const double* m = all + 16 * k;
      check(k, m[3], m[7], m[11], m[15]);
    }
    return reinterpret_cast<const fcl::Transform3d*>(all) + begin;
  }
  copy.resize(end - begin);
  for (std::size_t k = begin; k < end; ++k) {
    Eigen::Matrix4d& m = copy[k - begin].matrix();
    m = matrix(k);
    check(k, m(3, 0), m(3, 1), m(3, 2), m(3, 3));
  }
  return copy.data();
}

fcl::Transform3d pose(const char* name, const py::handle& object) {
  const Poses poses(name, object);
  if (!poses.shape().empty())
    refuse(name, "has the shape " + shapeText(py::array::ensure(object)) + "; (4, 4) is expected");
  std::vector<fcl::Transform3d> copy;
  return *poses.transforms(0, 1, copy);
}

std::string shapeOf(const std::vector<py::ssize_t>& leading) {
  std::string text = "(";
  for (const py::ssize_t n : leading) text += std::to_string(n) + ", ";
  return text + "4, 4)";
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
