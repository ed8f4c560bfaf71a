// SPDX-License-Identifier: BSD-3-Clause
#include "tree/box_tree.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace bocst::tree {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Corners, axes and sums of their products are off by less, in lattice units: 2^16 units have an ulp of 2^-36.
constexpr double kPad = 0x1p-30;

// The direction in which a covariance is largest. It need not be exact: boxes may have any axes.
Vector3d longestAxis(const Matrix3d& covariance) {
  int largest = 0;
  covariance.diagonal().maxCoeff(&largest);
  Vector3d axis = covariance.col(largest);
  if (!(axis.squaredNorm() > 1e-200)) return Vector3d::UnitX();
  for (int i = 0; i < 6; ++i) axis = covariance * axis.normalized();
  return axis.normalized();
}

// Along an edge of a triangle, and across it in the triangle's plane. The boxes along either of the two longest edges
// have the same area, so the one of the shorter outline is taken: that of a right angle has its sides, as the surface
// that the triangle is cut from may have. (Where no edge has a length, any axes will do.)
Matrix3d axesOf(const Vector3d (&corner)[3]) {
  Vector3d edge[3] = {corner[1] - corner[0], corner[2] - corner[1], corner[0] - corner[2]};
  std::sort(edge, edge + 3, [](const Vector3d& p, const Vector3d& q) { return p.squaredNorm() > q.squaredNorm(); });
  if (!(edge[0].squaredNorm() > 1e-200)) return Matrix3d::Identity();
  Matrix3d best;
  double least = std::numeric_limits<double>::infinity();
  for (int base = 0; base < 2; ++base) {
    Matrix3d axes;
    axes.col(0) = edge[base].normalized();
    Vector3d across = edge[1 - base];
    for (int i = 0; i < 2; ++i)
      across -= axes.col(0).dot(across) * axes.col(0);  // once leaves a part along a long edge
    const bool is_segment = !(across.squaredNorm() > 1e-24 * edge[0].squaredNorm());
    axes.col(1) = is_segment ? axes.col(0).unitOrthogonal() : across.normalized();
    axes.col(2) = axes.col(0).cross(axes.col(1));
    double outline = 0;
    for (int k = 0; k < 2; ++k) {
      const double at[2] = {axes.col(k).dot(edge[0]), -axes.col(k).dot(edge[1])};
      outline += std::max({at[0], at[1], 0.0}) - std::min({at[0], at[1], 0.0});
    }
    if (outline < least) least = outline, best = axes;
  }
  return best;
}

// The axes of the corners' covariance. That of what lies across the longest axis is summed along two axes of its own:
// next to the length it would be lost in rounding. `over` calls a function with each corner.
template <typename F>
Matrix3d principalAxes(double count, const F& over) {
  Vector3d sum = Vector3d::Zero();
  Matrix3d products = Matrix3d::Zero();
  over([&](const Vector3d& p) {
    sum += p;
    products += p * p.transpose();
  });
  const Vector3d longest = longestAxis(products / count - sum * sum.transpose() / (count * count));
  const Vector3d u = longest.unitOrthogonal(), v = longest.cross(u);
  double su = 0, sv = 0, suu = 0, suv = 0, svv = 0;
  over([&](const Vector3d& p) {
    const double x = u.dot(p), y = v.dot(p);
    su += x, sv += y, suu += x * x, suv += x * y, svv += y * y;
  });
  const double angle = std::atan2(2 * (suv - su * sv / count), suu - su * su / count - (svv - sv * sv / count)) / 2;
  Matrix3d axes;
  axes.col(0) = longest;
  axes.col(1) = std::cos(angle) * u + std::sin(angle) * v;
  axes.col(2) = longest.cross(axes.col(1));
  return axes;
}

}  // namespace

// Axes, and how far triangles reach along them.
struct BoxTree::Frame {
  explicit Frame(const Matrix3d& axes_) : axes(axes_) {}

  // `along` gives the coordinates along the axes of a point of the mesh.
  template <typename F>
  void add(const Item& item, const F& along) {
    for (const Vector3d& corner : item.corner) {
      const Vector3d p = along(corner);
      lo = lo.cwiseMin(p);
      hi = hi.cwiseMax(p);
    }
    const Vector3d middle = along(item.middle);
    first = first.cwiseMin(middle);
    last = last.cwiseMax(middle);
  }
  double area() const {
    const Vector3d size = hi - lo;
    return size.x() * size.y() + size.y() * size.z() + size.z() * size.x();
  }

  Matrix3d axes;
  Vector3d lo = Vector3d::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  Vector3d first = lo, last = hi;  // of the triangles' middles
};

BoxTree::BoxTree(const oracle::Surface& surface) {
  std::vector<Item> items(surface.triangle_count);
  for (std::uint32_t t = 0; t < items.size(); ++t) {
    for (int k = 0; k < 3; ++k) items[t].corner[k] = surface.corner(t, k);
    items[t].middle = (items[t].corner[0] + items[t].corner[1] + items[t].corner[2]) / 3;
    items[t].triangle = t;
  }
  nodes_.reserve(mostNodes(items.size()));
  triangles_.reserve(items.size());
  add(items.data(), items.data() + items.size());
}

void BoxTree::add(Item* begin, Item* end) {
  const Vector3d origin = begin->corner[0];
  constexpr std::ptrdiff_t kEnough = 256;  // the axes of this many triangles are nearly as good as those of all
  const std::ptrdiff_t step = (end - begin + kEnough - 1) / kEnough;
  const auto over_corners = [&](auto&& f) {
    for (const Item* i = begin; i < end; i += step) {
      for (const Vector3d& corner : i->corner) f(Vector3d(corner - origin));
    }
  };
  const auto size = static_cast<std::size_t>(end - begin);
  const bool is_leaf = size <= kMostInLeaf;
  const auto count = static_cast<double>(3 * ((end - begin + step - 1) / step));
  Frame frame(size == 1 ? axesOf(begin->corner) : principalAxes(count, over_corners));
  Frame straight(Matrix3d::Identity());
  const Matrix3d to_axes = frame.axes.transpose();
  for (const Item* i = begin; i != end; ++i) {
    frame.add(*i, [&](const Vector3d& p) -> Vector3d { return to_axes * (p - origin); });
    straight.add(*i, [&](const Vector3d& p) -> Vector3d { return p - origin; });
  }
  // Many parts are made along their own axes; those of a square's or a cube's covariance may be any.
  if (straight.area() < frame.area()) frame = straight;
  const std::size_t index = nodes_.size();
  nodes_.push_back({origin + frame.axes * ((frame.lo + frame.hi) / 2), frame.axes,
                    ((frame.hi - frame.lo) / 2).array() + kPad, 0, static_cast<std::uint32_t>(triangles_.size()),
                    is_leaf ? static_cast<std::uint32_t>(size) : 0});
  if (is_leaf) {
    for (const Item* i = begin; i != end; ++i) triangles_.push_back(i->triangle);
    return;
  }
  int widest = 0;
  (frame.last - frame.first).maxCoeff(&widest);
  const Vector3d along = frame.axes.col(widest);
  Item* const middle = begin + (end - begin) / 2;
  std::nth_element(begin, middle, end,
                   [&along](const Item& a, const Item& b) { return along.dot(a.middle) < along.dot(b.middle); });
  add(begin, middle);
  nodes_[index].second = static_cast<std::uint32_t>(nodes_.size());
  add(middle, end);
}

}  // namespace bocst::tree
