// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/collide_poses.h>
#include <fcl/common/types.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

// NumPy arrays as C++ wants them. What does not fit is refused with the argument's name: TypeError for what holds no
// numbers, ValueError for shapes and values.

namespace bocst::python {

namespace py = pybind11;

/// Doubles in C order, aligned, of any real or integer dtype and any layout; the array itself where it is that already.
py::array_t<double, py::array::c_style> doubles(const char* name, const py::handle& object);

/// An (n, 3) array of any dtype and layout as vectors, copied once.
std::vector<Eigen::Vector3d> vectors(const char* name, const py::handle& object);

/// (3,) and (3, 3), finite.
Eigen::Vector3d vector3(const char* name, const py::handle& object);
Eigen::Matrix3d matrix3(const char* name, const py::handle& object);

/// An (n, 3) array of integers >= 0 as the indices of a mesh.
std::vector<std::array<std::uint32_t, 3>> indices(const char* name, const py::handle& object);

/// Poses as 4x4 matrices in an array of shape (..., 4, 4). Reads doubles and floats of up to two dimensions of poses
/// where they lie, whatever the strides; converts other arrays once. Holds the array.
class Poses {
 public:
  Poses(const char* name, const py::handle& object);

  std::size_t count() const { return count_; }
  const std::vector<py::ssize_t>& shape() const { return shape_; }  ///< Without the last (4, 4).

  /// The order of the numbers of each matrix, if all matrices are doubles that lie one after the other, from numbers()
  /// on.
  const std::optional<MatrixOrder>& order() const { return order_; }
  const double* data() const { return reinterpret_cast<const double*>(data_); }

  /// Poses [begin, end) as C++ has them, written to `copy` where the array's layout is another. Needs no GIL.
  /// @throws std::invalid_argument unless the last row of each is 0 0 0 1.
  const fcl::Transform3d* transforms(std::size_t begin, std::size_t end, std::vector<fcl::Transform3d>& copy) const;

 private:
  static constexpr py::ssize_t kBytes = 16 * sizeof(double);  // of a matrix

  std::string indexText(std::size_t k) const;  ///< Where pose k is in the array, as in Python: "[3, 0]".
  Eigen::Matrix4d matrix(std::size_t k) const;

  const char* name_;
  py::array array_;
  const char* data_;
  std::size_t count_ = 1, inner_count_ = 1;
  py::ssize_t outer_ = 0, inner_ = 0, row_ = 0, column_ = 0;  // strides in bytes
  bool is_float_ = false;
  std::optional<MatrixOrder> order_;
  std::vector<py::ssize_t> shape_;
};

/// One of them, of shape (4, 4).
fcl::Transform3d pose(const char* name, const py::handle& object);

/// The shape of an array of poses, for messages: "(7, 4, 4)" of Poses::shape() {7}.
std::string shapeOf(const std::vector<py::ssize_t>& leading);

/// "1 node", "3 nodes".
std::string counted(std::size_t count, const char* one, const char* many = nullptr);

/// A copy as a NumPy array.
py::array_t<double> arrayOf(const Eigen::Vector3d& v);
py::array_t<double> arrayOf(const Eigen::Matrix3d& m);

}  // namespace bocst::python
