// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/options.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "render/view.h"

namespace bocst::render {

struct Color {
  float red = 0, green = 0, blue = 0;
};

/// A mesh at a pose. Triangles that are segments or points are drawn as such, a few pixels wide.
struct Surface {
  const Mesh* mesh = nullptr;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Color color;
  float opacity = 1;  ///< Below 1 it is glass: drawn last, and hides nothing.
};

/// Spheres or boxes at a pose, over the surfaces: of these only what is nearest to the eye is seen, mixed with what is
/// behind it.
struct Volumes {
  enum class Shape { kSpheres, kBoxes };
  struct Volume {
    Eigen::Vector3d center;
    Eigen::Vector3d half;  ///< Of a box's edges.
    double radius;         ///< Of a sphere.
  };

  std::vector<Volume> all;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  Shape shape = Shape::kSpheres;
  Color color;
  float opacity = 1;
};

struct Scene {
  std::vector<Surface> surfaces;
  std::vector<Volumes> volumes;  ///< Drawn in this order.
};

/// Pixels by rows, the uppermost first: 0xAARRGGBB, colours multiplied by alpha, as Cairo's ARGB32. Where nothing is
/// drawn they are 0.
struct Image {
  int width = 0, height = 0;
  std::vector<std::uint32_t> pixels;
};

/// Draws scenes without a display, on the EGL device that an oracle of this kind would take. To be made, used and ended
/// in one thread.
class Renderer {
 public:
  /// @throws OracleError that says why no picture can be drawn here.
  explicit Renderer(OracleKind oracle);
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// @throws OracleError when the device cannot: no memory, pictures too large, lost.
  Image draw(const Scene& scene, const View& view, int width, int height);

  /// How many of these points, which are on the surfaces, no other part of them hides. Volumes do not count.
  std::size_t countSeen(const Scene& scene, const View& view, int side, const std::vector<Eigen::Vector3d>& points);

  /// What draws, for people.
  const std::string& device() const;

 private:
  class Drawing;
  std::unique_ptr<Drawing> drawing_;
};

}  // namespace bocst::render
