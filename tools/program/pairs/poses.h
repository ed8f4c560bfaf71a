// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "pairs/query_pair.h"

namespace bocst::program {

constexpr double kPi = 3.14159265358979323846;

/// How the rotation of a pose is written.
enum class RotationFormat {
  kWxyz,  ///< qw,qx,qy,qz
  kXyzw,  ///< qx,qy,qz,qw, as in ROS
  kRpy,   ///< roll,pitch,yaw in radians: about the fixed axes x, y, z in turn, as in URDF
};

/// "x,y,z,qw,qx,qy,qz" and so on.
std::string spelling(RotationFormat format);

/// The pose of B in A's frame as the command line spells it: x,y,z,qw,qx,qy,qz. Every transform is made from these
/// seven numbers in one way, so a pose that was printed can be run again bit by bit.
struct Pose {
  std::array<double, 7> numbers{0, 0, 0, 1, 0, 0, 0};

  /// @throws std::invalid_argument when the text is not seven (six with kRpy) finite numbers with commas between, or
  /// the quaternion cannot be normalised.
  static Pose parse(const std::string& text, RotationFormat format = RotationFormat::kWxyz);

  /// Of numbers in that order; kRpy has six, and the last does not count. @throws std::invalid_argument as parse().
  static Pose of(const std::array<double, 7>& numbers, RotationFormat format = RotationFormat::kWxyz);

  static Pose fromTransform(const Eigen::Isometry3d& X_AB);  ///< To within rounding.

  double quaternionNorm() const;
  Eigen::Isometry3d transform() const;  ///< Of the quaternion divided by its norm.
  std::string text() const;

  /// The rotation in words: "turned by 90 degrees about (0, 0, 1)".
  std::string rotationText() const;
};

/// "the quaternion has the norm 0.5 and is normalised"; empty if its norm is about 1.
std::string normWarning(const Pose& pose);

/// A pose of a list and the line that it came from; the first line is 1.
struct ListedPose {
  std::size_t line;
  Pose pose;
};

/// The poses of a text, one a line, the numbers with commas, semicolons or blanks between. Empty lines, what follows #,
/// and a first line with the names of the columns, as spelling() has them, are skipped.
/// @param name of the file, for messages. @throws std::runtime_error that names the line that is no pose.
std::vector<ListedPose> parsePoses(const std::string& text, RotationFormat format, const std::string& name);

/// splitmix64, and only operations that IEEE 754 rounds correctly: the same poses on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t bits();
  double uniform();  ///< From [0, 1).
  double between(double low, double high) { return low + (high - low) * uniform(); }

  /// Uniform on the unit sphere of N dimensions, by rejection.
  template <int N>
  std::array<double, N> direction();

 private:
  std::uint64_t state_;
};

/// Poses of B in A's frame, where the meshes touch or nearly do. Along a random ray the distance at which they part is
/// found by bisection of a reference's verdicts.
class PoseSampler {
 public:
  PoseSampler(const Mesh& a, const Mesh& b, const QueryPair& reference, std::uint64_t seed);

  static constexpr std::size_t kPosesOnRay = 8;

  /// Poses on a ray that follows from the seed and its number alone, so that a run can be divided. Six lie off contact
  /// by 1e-9 to 1e-1 of the smaller radius, evenly in the logarithm and to both sides; two anywhere on the ray, as
  /// nextAnywhere().
  std::array<Pose, kPosesOnRay> aroundContact(std::uint64_t ray);

  /// Each on a ray of its own, from where the meshes begin to touch to half as far again beyond where they part: about
  /// two of three touch.
  Pose nextAnywhere();

  /// The radius of the sphere about the bounds of the smaller mesh.
  double smallerRadius() const { return std::min(radius_a_, radius_b_); }

 private:
  /// @throws std::runtime_error when no ray finds a pose in which the meshes touch.
  void nextRay(int steps);
  Pose at(double distance) const;
  bool touches(double distance) const;
  Pose anywhereOnRay();

  const QueryPair& reference_;
  const std::uint64_t seed_;
  Random random_;
  Eigen::Vector3d center_a_;
  Eigen::Vector3d center_b_;
  double radius_a_;
  double radius_b_;
  std::array<double, 4> rotation_{1, 0, 0, 0};
  Eigen::Vector3d ray_ = Eigen::Vector3d::UnitX();
  double inner_ = 0;    ///< On the ray, the meshes touch from about here
  double contact_ = 0;  ///< to here, though maybe not all the way.
};

}  // namespace bocst::program
