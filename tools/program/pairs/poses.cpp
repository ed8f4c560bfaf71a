// SPDX-License-Identifier: BSD-3-Clause
#include "pairs/poses.h"

#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>

#include "io/text.h"
#include "pairs/cells.h"

namespace bocst::program {

namespace {

std::array<double, 4> quaternionOf(double roll, double pitch, double yaw) {
  const Eigen::Quaterniond q = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                               Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX());
  return {q.w(), q.x(), q.y(), q.z()};
}

std::string shortest(double number) {
  char buffer[64];
  const std::to_chars_result r = std::to_chars(buffer, buffer + sizeof(buffer), number);
  return {buffer, r.ptr};
}

bool isName(const std::string& cell) {
  double number = 0;
  return !cell.empty() && std::isalpha(static_cast<unsigned char>(cell.front())) != 0 && !io::toNumber(cell, number);
}

// Columns in another order would be other poses.
void checkNames(const std::vector<std::string>& cells, RotationFormat format) {
  std::string names;
  for (const std::string& cell : cells) {
    if (!names.empty()) names += ',';
    for (const char c : cell) names += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  if (names == spelling(format)) return;
  for (const RotationFormat other : {RotationFormat::kWxyz, RotationFormat::kXyzw, RotationFormat::kRpy}) {
    if (names != spelling(other)) continue;
    throw std::invalid_argument("the columns are " + names +
                                (other == RotationFormat::kXyzw  ? "; add --xyzw"
                                 : other == RotationFormat::kRpy ? "; add --rpy"
                                                                 : "; leave out --xyzw and --rpy"));
  }
  throw std::invalid_argument("the columns must be named " + spelling(format));
}

Pose poseOf(const std::vector<std::string>& words, RotationFormat format) {
  const std::size_t count = format == RotationFormat::kRpy ? 6 : 7;
  std::array<double, 7> numbers{};
  bool are_numbers = words.size() == count;
  for (std::size_t i = 0; i < count && are_numbers; ++i) are_numbers = io::toNumber(words[i], numbers[i]);
  if (!are_numbers) throw std::invalid_argument(std::to_string(count) + " numbers " + spelling(format) + " expected");
  return Pose::of(numbers, format);
}

}  // namespace

std::string spelling(RotationFormat format) {
  return format == RotationFormat::kWxyz   ? "x,y,z,qw,qx,qy,qz"
         : format == RotationFormat::kXyzw ? "x,y,z,qx,qy,qz,qw"
                                           : "x,y,z,roll,pitch,yaw";
}

Pose Pose::parse(const std::string& text, RotationFormat format) {
  std::vector<std::string> words(1);
  for (const char c : text) {
    if (c == ',') {
      words.emplace_back();
    } else if (c != ' ' || !words.back().empty()) {
      words.back() += c;
    }
  }
  return poseOf(words, format);
}

Pose Pose::of(const std::array<double, 7>& given, RotationFormat format) {
  const auto& [x, y, z, r0, r1, r2, r3] = given;
  for (const double number : given) {
    if (!std::isfinite(number)) {
      throw std::invalid_argument(std::string("a pose must have finite numbers; one of them is ") +
                                  (std::isnan(number) ? "not a number" : "infinite"));
    }
  }
  Pose pose;
  pose.numbers = given;
  if (format == RotationFormat::kXyzw) pose.numbers = {x, y, z, r3, r0, r1, r2};
  if (format == RotationFormat::kRpy) {
    const auto [qw, qx, qy, qz] = quaternionOf(r0, r1, r2);
    pose.numbers = {x, y, z, qw, qx, qy, qz};
  }
  const double norm = pose.quaternionNorm();
  if (!(norm > 1e-100) || !std::isfinite(norm))
    throw std::invalid_argument("the quaternion has the length 0, or one too large, and is no rotation");
  return pose;
}

Pose Pose::fromTransform(const Eigen::Isometry3d& X_AB) {
  const Eigen::Quaterniond q(X_AB.linear());
  const Eigen::Vector3d& p = X_AB.translation();
  return of({p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
}

std::vector<ListedPose> parsePoses(const std::string& text, RotationFormat format, const std::string& name) {
  std::vector<ListedPose> poses;
  std::istringstream stream{std::string(io::withoutByteOrderMark(text))};
  std::string line;
  for (std::size_t number = 1; std::getline(stream, line); ++number) {
    try {
      const std::vector<std::string> cells = cellsOf(line, Blanks::kSeparate);
      if (cells.size() == 1 && cells[0].empty()) continue;
      if (number == 1 && isName(cells[0])) {
        checkNames(cells, format);
      } else {
        poses.push_back({number, poseOf(cells, format)});
      }
    } catch (const std::invalid_argument& e) {
      throw std::runtime_error(name + ": line " + std::to_string(number) + ": " + e.what());
    }
  }
  if (poses.empty()) throw std::runtime_error(name + ": no poses");
  return poses;
}

std::string normWarning(const Pose& pose) {
  const double norm = pose.quaternionNorm();
  if (std::abs(norm - 1) <= 1e-3) return "";
  std::ostringstream text;
  text << "the quaternion has the norm " << norm << " and is normalised";
  return text.str();
}

double Pose::quaternionNorm() const {
  const double qw = numbers[3], qx = numbers[4], qy = numbers[5], qz = numbers[6];
  return std::sqrt(((qw * qw + qx * qx) + qy * qy) + qz * qz);
}

Eigen::Isometry3d Pose::transform() const {
  const auto& [x, y, z, qw, qx, qy, qz] = numbers;
  const double norm = quaternionNorm();
  const Eigen::Quaterniond q(qw / norm, qx / norm, qy / norm, qz / norm);
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = q.toRotationMatrix();
  X.translation() = Eigen::Vector3d(x, y, z);
  return X;
}

std::string Pose::text() const {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ",") + shortest(number);
  return text;
}

std::string Pose::rotationText() const {
  const Eigen::AngleAxisd turn(transform().linear());
  if (turn.angle() < 1e-12) return "not turned";
  // The axis with its largest coordinate positive, so that a quarter turn about z is never called one about -z by 270.
  Eigen::Vector3d axis = turn.axis();
  double angle = turn.angle();
  int largest = 0;
  axis.cwiseAbs().maxCoeff(&largest);
  if (axis[largest] < 0) {
    axis = -axis;
    angle = -angle;
  }
  char text[160];
  const auto tidy = [](double x) { return std::abs(x) < 5e-7 ? 0.0 : x; };
  std::snprintf(text, sizeof(text), "turned by %.6g degrees about (%.6g, %.6g, %.6g)", angle * 180 / M_PI,
                tidy(axis.x()), tidy(axis.y()), tidy(axis.z()));
  return text;
}

std::uint64_t Random::bits() {
  std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

double Random::uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

template <int N>
std::array<double, N> Random::direction() {
  while (true) {
    std::array<double, N> v;
    double square = 0;
    for (double& x : v) {
      x = between(-1, 1);
      square += x * x;
    }
    if (square > 1 || square < 1e-4) continue;
    const double norm = std::sqrt(square);
    for (double& x : v) x /= norm;
    return v;
  }
}

PoseSampler::PoseSampler(const Mesh& a, const Mesh& b, const QueryPair& reference, std::uint64_t seed)
    : reference_(reference),
      seed_(seed),
      random_(seed),
      center_a_(a.bounds().center()),
      center_b_(b.bounds().center()),
      radius_a_(a.bounds().sizes().norm() / 2),
      radius_b_(b.bounds().sizes().norm() / 2) {}

Pose PoseSampler::at(double distance) const {
  // B's centre lies on the ray from A's centre.
  Pose pose;
  std::copy(rotation_.begin(), rotation_.end(), pose.numbers.begin() + 3);
  const Eigen::Matrix3d rotation = pose.transform().linear();
  for (int i = 0; i < 3; ++i) {
    const double turned =
        (rotation(i, 0) * center_b_[0] + rotation(i, 1) * center_b_[1]) + rotation(i, 2) * center_b_[2];
    pose.numbers[static_cast<std::size_t>(i)] = (center_a_[i] - turned) + distance * ray_[i];
  }
  return pose;
}

bool PoseSampler::touches(double distance) const { return reference_.touch(at(distance).transform()); }

Pose PoseSampler::anywhereOnRay() { return at(inner_ + random_.between(0, 1.5) * (contact_ - inner_)); }

void PoseSampler::nextRay(int steps) {
  for (int attempt = 0; attempt < 1000; ++attempt) {
    rotation_ = random_.direction<4>();
    const std::array<double, 3> ray = random_.direction<3>();
    ray_ = Eigen::Vector3d(ray[0], ray[1], ray[2]);
    double free = (radius_a_ + radius_b_) * 1.01;
    // Surfaces may miss each other when their centres meet (hollow, or bent around one another): then look outwards.
    constexpr int kLooks = 16;
    double inner = 0;
    double touching = -1;
    for (int k = 0; k < kLooks && touching < 0; ++k) {
      const double distance = free * k / kLooks;
      (touches(distance) ? touching : inner) = distance;
    }
    if (touching < 0) continue;
    double inner_touching = touching;
    for (int step = 0; step < steps; ++step) {
      const double middle = (touching + free) / 2;
      (touches(middle) ? touching : free) = middle;
    }
    for (int step = 0; step < 8 && inner_touching > inner; ++step) {
      const double middle = (inner_touching + inner) / 2;
      (touches(middle) ? inner_touching : inner) = middle;
    }
    contact_ = (touching + free) / 2;
    inner_ = inner;
    return;
  }
  throw std::runtime_error("no pose found in which the two meshes touch");
}

std::array<Pose, PoseSampler::kPosesOnRay> PoseSampler::aroundContact(std::uint64_t ray) {
  random_ = Random(Random(seed_).bits() ^ Random(ray).bits());
  nextRay(40);
  std::array<Pose, kPosesOnRay> poses;
  for (std::size_t i = 0; i < 6; ++i) {
    const int exponent = -30 + static_cast<int>(random_.bits() % 27);  // 2^-30 to 2^-3
    const double gap = std::ldexp(1 + random_.uniform(), exponent) * smallerRadius();
    poses[i] = at(contact_ + (i % 2 == 0 ? -gap : gap));
  }
  for (std::size_t i = 6; i < kPosesOnRay; ++i) poses[i] = anywhereOnRay();
  return poses;
}

Pose PoseSampler::nextAnywhere() {
  nextRay(12);
  return anywhereOnRay();
}

}  // namespace bocst::program
