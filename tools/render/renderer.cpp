// SPDX-License-Identifier: BSD-3-Clause
#include "render/renderer.h"

#include <bocst/oracle.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>

#include "egl/context.h"
#include "egl/handles.h"
#include "egl/oracle_selection.h"
#include "render/shaders.h"

namespace bocst::render {
namespace {

namespace gl = oracle::gl;

constexpr int kSamples = 3;            // a side of a pixel: spheres end inside triangles, where no multisampling helps
constexpr float kStrokePixels = 2.5f;  // of triangles without area
constexpr double kSliver = 1e-7;       // what is thinner, of its length, no sample would see
constexpr float kBoxEdgePixels = 1.25f;

gl::Program program(const char* vertex, const char* fragment) {
  const std::string head = "#version 330 core\n";
  return gl::Program(
      {{GL_VERTEX_SHADER, head + shader(vertex)}, {GL_FRAGMENT_SHADER, head + shader("light") + shader(fragment)}});
}

gl::ContextRequest requestFor(OracleKind oracle) {
  gl::ContextRequest request;
  request.device = oracle::oracleSelectionOf(oracle).device;
  request.major = 3;
  request.minor = 3;
  return request;
}

template <typename T>
std::size_t bytesOf(const std::vector<T>& list) {
  return list.size() * sizeof(T);
}

/// A surface in eye coordinates.
struct Triangles {
  std::vector<Eigen::Vector3f> positions;
  std::vector<std::uint32_t> indices;
  std::vector<std::array<Eigen::Vector3f, 2>> strokes;  ///< The longest edges of triangles without area.
};

Triangles trianglesOf(const Surface& surface, const View& view) {
  const Mesh& mesh = *surface.mesh;
  Triangles result;
  result.positions.reserve(mesh.vertexCount());
  for (const Eigen::Vector3d& v : mesh.vertices()) {
    result.positions.push_back(view.toEye(surface.pose * v).cast<float>());
  }
  result.indices.reserve(3 * mesh.triangleCount());
  for (const Mesh::Indices& t : mesh.triangles()) {
    const std::array<Eigen::Vector3d, 3> c = {mesh.vertex(t[0]), mesh.vertex(t[1]), mesh.vertex(t[2])};
    std::size_t longest = 0;
    const auto square = [&c](std::size_t i) { return (c[(i + 1) % 3] - c[i]).squaredNorm(); };
    for (const std::size_t i : {1, 2}) longest = square(i) > square(longest) ? i : longest;
    if ((c[1] - c[0]).cross(c[2] - c[0]).norm() > kSliver * square(longest)) {
      result.indices.insert(result.indices.end(), t.begin(), t.end());
      continue;
    }
    result.strokes.push_back({result.positions[t[longest]], result.positions[t[(longest + 1) % 3]]});
  }
  return result;
}

/// Center, half extents, radius: in units of the view's radius, the center in eye coordinates.
using Instance = std::array<float, 7>;

std::vector<Instance> instancesOf(const Volumes& volumes, const View& view) {
  std::vector<Instance> result;
  result.reserve(volumes.all.size());
  for (const Volumes::Volume& v : volumes.all) {
    const Eigen::Vector3f center = view.toEye(volumes.pose * v.center).cast<float>();
    const Eigen::Vector3f half = (v.half / view.radius).cast<float>();
    result.push_back(
        {center.x(), center.y(), center.z(), half.x(), half.y(), half.z(), static_cast<float>(v.radius / view.radius)});
  }
  return result;
}

void attribute(GLuint at, GLint size, std::size_t stride, std::size_t offset, GLuint divisor) {
  glEnableVertexAttribArray(at);
  glVertexAttribPointer(at, size, GL_FLOAT, GL_FALSE, static_cast<GLsizei>(stride), reinterpret_cast<void*>(offset));
  glVertexAttribDivisor(at, divisor);
}

constexpr std::array<float, 24> kBoxCorners = {-1, -1, -1, 1, -1, -1, -1, 1, -1, 1, 1, -1,
                                               -1, -1, 1,  1, -1, 1,  -1, 1, 1,  1, 1, 1};
constexpr std::array<std::uint16_t, 36> kBoxFaces = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                                     2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

/// The mean of kSamples x kSamples samples a pixel, turned the right way up.
Image reduced(const std::vector<std::uint32_t>& samples, int width, int height) {
  Image image{width, height,
              std::vector<std::uint32_t>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  constexpr std::size_t kSide = kSamples;
  for (std::size_t y = 0; y < h; ++y) {
    for (std::size_t x = 0; x < w; ++x) {
      std::array<std::uint32_t, 4> sum{};
      for (std::size_t i = 0; i < kSide * kSide; ++i) {
        const std::uint32_t sample = samples[(kSide * (h - 1 - y) + i / kSide) * kSide * w + kSide * x + i % kSide];
        for (std::size_t k = 0; k < 4; ++k) sum[k] += sample >> (8 * k) & 255;
      }
      std::uint32_t& pixel = image.pixels[y * w + x];
      for (std::size_t k = 0; k < 4; ++k) pixel |= (sum[k] + kSide * kSide / 2) / (kSide * kSide) << (8 * k);
    }
  }
  return image;
}

}  // namespace

/// The OpenGL objects.
class Renderer::Drawing {
 public:
  explicit Drawing(OracleKind oracle)
      : context_(requestFor(oracle)),
        mesh_(program("mesh_vertex", "mesh_fragment")),
        stroke_(program("stroke_vertex", "stroke_fragment")),
        sphere_(program("sphere_vertex", "sphere_fragment")),
        box_(program("box_vertex", "box_fragment")),
        corners_(sizeof(kBoxCorners), kBoxCorners.data()),
        faces_(sizeof(kBoxFaces), kBoxFaces.data()) {}

  const std::string& device() const { return context_.info().renderer; }

  Image draw(const Scene& scene, const View& view, int width, int height) {
    prepare(view, width, height);
    for (const Surface& surface : scene.surfaces) {
      if (surface.opacity >= 1) drawSurface(surface, view);
    }
    for (const Volumes& volumes : scene.volumes) drawVolumes(volumes, view);
    glDepthMask(GL_FALSE);
    for (const Surface& surface : scene.surfaces) {
      if (surface.opacity < 1) drawSurface(surface, view);
    }
    glDepthMask(GL_TRUE);
    const std::vector<std::uint32_t> samples = read<std::uint32_t>(width, height, GL_BGRA, GL_UNSIGNED_INT_8_8_8_8_REV);
    return reduced(samples, width, height);
  }

  std::size_t countSeen(const Scene& scene, const View& view, int side, const std::vector<Eigen::Vector3d>& points) {
    constexpr double kSlack = 0.01;  // of the view's radius: a surface is not flat within a pixel
    prepare(view, side, side);
    for (const Surface& surface : scene.surfaces) drawSurface(surface, view);
    const std::vector<float> depths = read<float>(side, side, GL_DEPTH_COMPONENT, GL_FLOAT);
    const int across = kSamples * side;
    return static_cast<std::size_t>(std::count_if(points.begin(), points.end(), [&](const Eigen::Vector3d& point) {
      const Eigen::Vector3d eye = view.toEye(point);
      const auto at = [&](double x) { return std::clamp(static_cast<int>((x + 1) / 2 * across), 0, across - 1); };
      const float depth = depths[static_cast<std::size_t>(at(eye.y())) * static_cast<std::size_t>(across) +
                                 static_cast<std::size_t>(at(eye.x()))];
      return (eye.z() + kSlack) * view.radius / view.reach >= 1 - 2 * static_cast<double>(depth);
    }));
  }

 private:
  /// All samples of a picture of that size, the lowest row first. @throws OracleError when the drawing failed, too.
  template <typename T>
  std::vector<T> read(int width, int height, GLenum format, GLenum type) const {
    glBindVertexArray(0);
    const int w = kSamples * width, h = kSamples * height;
    std::vector<T> samples(static_cast<std::size_t>(w) * static_cast<std::size_t>(h));
    glReadPixels(0, 0, w, h, format, type, samples.data());
    const GLenum error = glGetError();
    if (context_.isLost()) throw OracleError("the GPU context was lost while a picture was drawn");
    if (error == GL_OUT_OF_MEMORY) throw OracleError("the GPU has not enough memory for this picture");
    if (error != GL_NO_ERROR) throw OracleError("OpenGL error " + std::to_string(error) + " while a picture was drawn");
    return samples;
  }

  void prepare(const View& view, int width, int height) {
    gl::forgetErrors();
    const auto smaller = static_cast<float>(std::min(width, height));
    scale_ = {smaller / static_cast<float>(width), smaller / static_cast<float>(height),
              static_cast<float>(-view.radius / view.reach)};
    pixel_ = {2 / static_cast<float>(width), 2 / static_cast<float>(height)};
    GLint most = 0;
    glGetIntegerv(GL_MAX_RENDERBUFFER_SIZE, &most);
    const int w = kSamples * width, h = kSamples * height;
    if (w <= most && h <= most) {
      glBindRenderbuffer(GL_RENDERBUFFER, color_.name());
      glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8, w, h);
      glBindRenderbuffer(GL_RENDERBUFFER, depth_.name());
      glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT24, w, h);
      glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.name());
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_.name());
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_.name());
    }
    if (w > most || h > most || glCheckFramebufferStatus(GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE) {
      throw OracleError("the driver cannot render to a picture of " + std::to_string(w) + " x " + std::to_string(h) +
                        " pixels");
    }
    glViewport(0, 0, w, h);
    glDisable(GL_CULL_FACE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);
    glEnable(GL_BLEND);
    // What is drawn is multiplied by its alpha, which the picture keeps.
    glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ONE, GL_ONE_MINUS_SRC_ALPHA);
    glClearColor(0, 0, 0, 0);
    glClear(GL_COLOR_BUFFER_BIT | GL_DEPTH_BUFFER_BIT);
  }

  void use(const gl::Program& program, const Color& color, float opacity) const {
    program.use();
    glUniform3f(program.uniform("u_scale"), scale_[0], scale_[1], scale_[2]);
    glUniform3f(program.uniform("u_color"), color.red, color.green, color.blue);
    glUniform1f(program.uniform("u_opacity"), opacity);
  }

  void drawSurface(const Surface& surface, const View& view) const {
    const Triangles triangles = trianglesOf(surface, view);
    const gl::VertexArray array;
    glBindVertexArray(array.name());
    if (!triangles.indices.empty()) {
      const gl::Buffer positions(bytesOf(triangles.positions), triangles.positions.data());
      const gl::Buffer indices(bytesOf(triangles.indices), triangles.indices.data());
      glBindBuffer(GL_ARRAY_BUFFER, positions.name());
      attribute(0, 3, sizeof(Eigen::Vector3f), 0, 0);
      glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, indices.name());
      use(mesh_, surface.color, surface.opacity);
      glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(triangles.indices.size()), GL_UNSIGNED_INT, nullptr);
    }
    if (!triangles.strokes.empty()) {
      const gl::Buffer ends(bytesOf(triangles.strokes), triangles.strokes.data());
      glBindBuffer(GL_ARRAY_BUFFER, ends.name());
      glDisableVertexAttribArray(0);
      attribute(1, 3, sizeof(triangles.strokes[0]), 0, 1);
      attribute(2, 3, sizeof(triangles.strokes[0]), sizeof(Eigen::Vector3f), 1);
      use(stroke_, surface.color, surface.opacity);
      glUniform2f(stroke_.uniform("u_pixel"), pixel_[0], pixel_[1]);
      glUniform1f(stroke_.uniform("u_pixels"), kStrokePixels);
      glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(triangles.strokes.size()));
    }
  }

  void drawVolumes(const Volumes& volumes, const View& view) const {
    if (volumes.all.empty()) return;
    const bool boxes = volumes.shape == Volumes::Shape::kBoxes;
    const std::vector<Instance> instances = instancesOf(volumes, view);
    const gl::Buffer data(bytesOf(instances), instances.data());
    const gl::VertexArray array;
    glBindVertexArray(array.name());
    if (boxes) {
      glBindBuffer(GL_ARRAY_BUFFER, corners_.name());
      attribute(0, 3, 3 * sizeof(float), 0, 0);
      glBindBuffer(GL_ELEMENT_ARRAY_BUFFER, faces_.name());
    }
    glBindBuffer(GL_ARRAY_BUFFER, data.name());
    attribute(1, 3, sizeof(Instance), 0, 1);
    if (boxes) {
      attribute(2, 3, sizeof(Instance), 3 * sizeof(float), 1);
    } else {
      attribute(3, 1, sizeof(Instance), 6 * sizeof(float), 1);
    }
    const gl::Program& program = boxes ? box_ : sphere_;
    use(program, volumes.color, volumes.opacity);
    if (boxes) {
      const Eigen::Matrix3f axes = (view.axes * volumes.pose.linear()).cast<float>();
      glUniformMatrix3fv(program.uniform("u_axes"), 1, GL_FALSE, axes.data());
      glUniform1f(program.uniform("u_pixels"), kBoxEdgePixels * kSamples);
    }
    // The nearest surface first, in depth alone; then only that is mixed with what is behind it, each pixel once.
    const auto count = static_cast<GLsizei>(instances.size());
    for (const bool depth_only : {true, false}) {
      const GLboolean writes = depth_only ? GL_FALSE : GL_TRUE;
      glColorMask(writes, writes, writes, writes);
      glDepthFunc(depth_only ? GL_LESS : GL_EQUAL);
      if (boxes) {
        glDrawElementsInstanced(GL_TRIANGLES, static_cast<GLsizei>(kBoxFaces.size()), GL_UNSIGNED_SHORT, nullptr,
                                count);
      } else {
        glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, count);
      }
    }
    glDepthFunc(GL_LESS);
  }

  // Before what needs it current.
  gl::Context context_;
  gl::Program mesh_, stroke_, sphere_, box_;
  gl::Buffer corners_, faces_;
  gl::Framebuffer framebuffer_;
  gl::Renderbuffer color_, depth_;
  std::array<float, 3> scale_{};
  std::array<float, 2> pixel_{};
};

Renderer::Renderer(OracleKind oracle) {
  try {
    drawing_ = std::make_unique<Drawing>(oracle);
  } catch (const OracleError& e) {
    throw OracleError(std::string("no picture can be drawn: ") + e.what());
  }
}

Renderer::~Renderer() = default;

Image Renderer::draw(const Scene& scene, const View& view, int width, int height) {
  return drawing_->draw(scene, view, width, height);
}

std::size_t Renderer::countSeen(const Scene& scene, const View& view, int side,
                                const std::vector<Eigen::Vector3d>& points) {
  return drawing_->countSeen(scene, view, side, points);
}

const std::string& Renderer::device() const { return drawing_->device(); }

}  // namespace bocst::render
