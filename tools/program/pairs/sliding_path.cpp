// SPDX-License-Identifier: BSD-3-Clause
#include "pairs/sliding_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "pairs/poses.h"

namespace bocst::program {
namespace {

constexpr std::size_t kFramesOfKey = 4;  ///< Between two poses whose contact is looked for.
constexpr double kStep = 0.01;           ///< Of the smaller radius, a frame.
constexpr double kTurn = 2 * kPi / 2000;
constexpr double kSteepest = 4;  ///< Up and down over along.
constexpr double kSunk = 0.01;   ///< Of the smaller radius: how deep at most, and half as far off, where contact was
                                 ///< looked for.

double radiusOf(const Mesh& mesh) { return mesh.bounds().sizes().norm() / 2; }

class Path {
 public:
  Path(const Mesh& a, const Mesh& b, const QueryPair& reference, std::uint64_t seed)
      : reference_(reference),
        a_is_larger_(radiusOf(a) >= radiusOf(b)),
        larger_(a_is_larger_ ? a : b),
        smaller_(a_is_larger_ ? b : a),
        reach_(radiusOf(a) + radiusOf(b)),
        angle_(std::min(kTurn, kStep * radiusOf(smaller_) / reach_)) {
    Random random(seed);
    const auto direction = [&random] {
      Eigen::Vector3d v;
      for (double& x : v) x = random.between(-1, 1);
      return v.normalized().eval();
    };
    axis_ = direction();
    start_ = axis_.unitOrthogonal();
    turn_axis_ = direction();
    first_turn_ = random.between(0, 2 * kPi);
  }

  std::vector<Eigen::Isometry3d> poses(std::size_t frames) {
    lookForContact(frames / kFramesOfKey + 2);
    limitSlopes();
    for (std::size_t k = 0; k < keys_.size(); ++k) {
      keys_[k] -= kSunk * radiusOf(smaller_) * (0.25 + 0.75 * std::sin(static_cast<double>(k)));
    }
    std::vector<Eigen::Isometry3d> poses;
    for (std::size_t i = 0; i < frames; ++i) poses.push_back(at(static_cast<double>(i), distanceAt(i)));
    return poses;
  }

 private:
  /// The direction from the larger mesh's middle to the smaller one's.
  Eigen::Vector3d ray(double frame) const {
    const double angle = angle_ * frame;
    const Eigen::Vector3d around = Eigen::AngleAxisd(angle, axis_) * start_;
    return (around + 0.3 * std::sin(3 * angle) * axis_).normalized();
  }

  /// X_AB at a distance of both middles.
  Eigen::Isometry3d at(double frame, double distance) const {
    Eigen::Isometry3d X_LS = Eigen::Isometry3d::Identity();
    X_LS.linear() = Eigen::AngleAxisd(first_turn_ + kTurn * frame, turn_axis_).toRotationMatrix();
    X_LS.translation() = larger_.bounds().center() + distance * ray(frame) - X_LS.linear() * smaller_.bounds().center();
    return a_is_larger_ ? X_LS : X_LS.inverse();
  }

  /// Where the smaller mesh meets the larger one first, coming in along the ray; NaN if it goes through to the middle.
  double contactAt(double frame) const {
    const double near = 1e-4 * radiusOf(smaller_);
    double distance = 1.01 * reach_;
    for (int i = 0; i < 1000 && distance > 0; ++i) {
      const double gap = reference_.distance(at(frame, distance));
      if (gap <= near) return distance;
      distance -= gap;
    }
    return std::numeric_limits<double>::quiet_NaN();
  }

  void lookForContact(std::size_t keys) {
    for (std::size_t k = 0; k < keys; ++k) {
      double distance = contactAt(static_cast<double>(k * kFramesOfKey));
      if (std::isnan(distance) && !keys_.empty()) distance = keys_.back();
      keys_.push_back(distance);
    }
    const auto first = std::find_if(keys_.begin(), keys_.end(), [](double distance) { return !std::isnan(distance); });
    if (first == keys_.end()) throw std::runtime_error("no contact found for one mesh to slide along");
    std::fill(keys_.begin(), first, *first);
  }

  /// Climbs before what juts out, and comes down behind it.
  void limitSlopes() {
    const double most = kSteepest * angle_ * kFramesOfKey * reach_;
    for (std::size_t k = 1; k < keys_.size(); ++k) keys_[k] = std::max(keys_[k], keys_[k - 1] - most);
    for (std::size_t k = keys_.size() - 1; k > 0; --k) keys_[k - 1] = std::max(keys_[k - 1], keys_[k] - most);
  }

  /// Cubic between the keys (Catmull and Rom).
  double distanceAt(std::size_t frame) const {
    const std::size_t k = frame / kFramesOfKey;
    const double t = static_cast<double>(frame % kFramesOfKey) / kFramesOfKey;
    const double p0 = keys_[k > 0 ? k - 1 : 0], p1 = keys_[k], p2 = keys_[k + 1];
    const double p3 = keys_[std::min(k + 2, keys_.size() - 1)];
    return p1 + t / 2 * (p2 - p0 + t * (2 * p0 - 5 * p1 + 4 * p2 - p3 + t * (3 * (p1 - p2) + p3 - p0)));
  }

  const QueryPair& reference_;
  const bool a_is_larger_;
  const Mesh& larger_;
  const Mesh& smaller_;
  const double reach_;  ///< No contact of two middles that are farther apart.
  const double angle_;  ///< Around the larger mesh, a frame.
  Eigen::Vector3d axis_, start_, turn_axis_;
  double first_turn_ = 0;
  std::vector<double> keys_;  ///< Distances.
};

}  // namespace

std::vector<Eigen::Isometry3d> slidingPath(const Mesh& a, const Mesh& b, const QueryPair& reference, std::uint64_t seed,
                                           std::size_t frames) {
  return Path(a, b, reference, seed).poses(frames);
}

}  // namespace bocst::program
