// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/mesh.h>
#include <bocst/options.h>

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace bocst::program {

/// The paper's animation (5.4): an object is moved over three others on a fixed path. Objects have their middle at
/// their origin and d_t as their largest extent; lengths are those units, z is up.
class Animation {
 public:
  static constexpr std::size_t kObstacles = 3;
  static constexpr std::size_t kSeconds = 7;  ///< The paper's took 6.5 to 8.8.
  static constexpr std::size_t kPaperFrames = 2200;
  static constexpr std::chrono::milliseconds kMaxTime{2000};
  static constexpr std::array<double, 3> kDimensions{514, 832, 1024};

  /// Lays the path with objects of the smallest d_t: at rest over the first obstacle the object has sunk into it, over
  /// the other two it is just clear. The path is the same for all d_t, so larger objects meet more.
  Animation(std::shared_ptr<const Mesh> object, std::array<std::shared_ptr<const Mesh>, kObstacles> obstacles,
            std::size_t frames);

  std::size_t frames() const { return frames_; }
  double timeOf(std::size_t frame) const {
    return static_cast<double>(kSeconds) * static_cast<double>(frame) / static_cast<double>(frames_);
  }
  /// The object in the world.
  Eigen::Isometry3d poseAt(double time) const;
  /// It stands still in all of this second, 1 to kSeconds.
  static bool rests(std::size_t second);

  static Eigen::Isometry3d poseOf(std::size_t obstacle);

  const Mesh& object() const { return *object_; }
  const Mesh& obstacle(std::size_t i) const { return *obstacles_[i]; }

  /// Whether any pair touches, by frame, from FCL's OBBRSS trees.
  std::vector<bool> touching(double dimension) const;

  struct Setting {
    Subdivision subdivision = Subdivision::kOctree;
    int depth = 5;
    double dimension = 0;
    OracleKind oracle = OracleKind::kCpu;
  };

  /// A second of the animation, or all of it.
  struct Part {
    std::size_t frames = 0;
    std::size_t hits = 0;             ///< Frames in which a pair collides.
    std::uint64_t octants = 0;        ///< Statistics::expanded_octants.
    std::uint64_t still_octants = 0;  ///< Of those, of frames in which the object is where it was in the one before.
    std::uint64_t gl_queries = 0;     ///< Occlusion queries that OpenGL was given.
    double microseconds = 0;          ///< Of the queries alone.
    double quiet_microseconds = 0;    ///< Of those of frames that ask nothing.
  };

  struct Run {
    std::vector<Part> seconds;
    Part all;
    std::vector<bool> hit;           ///< By frame.
    std::size_t peak_nodes = 0;      ///< Resident in the four trees together.
    std::size_t last_nodes = 0;      ///< After the last frame.
    std::uint64_t pruned_nodes = 0;  ///< Dropped because unused for Max. time.
  };

  /// Three collide() a frame, on conservative models that are fresh and have a clock of their own: the animation takes
  /// kSeconds, however fast the queries are. It is run a few times, unless that takes long; times are the least of each
  /// second. @throws std::logic_error when two runs differ in what they find or ask.
  Run run(const Setting& setting) const;

 private:
  struct Key {
    double time;
    Eigen::Vector3d position;
    double turn;  // about z
  };

  Run runOnce(const Setting& setting) const;
  static Eigen::Isometry3d pose(const Key& key);

  std::shared_ptr<const Mesh> object_;
  std::array<std::shared_ptr<const Mesh>, kObstacles> obstacles_;
  std::size_t frames_;
  std::vector<Key> keys_;
};

}  // namespace bocst::program
