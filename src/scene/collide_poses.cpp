// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/collide_poses.h>

#include <algorithm>
#include <limits>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/validate.h"
#include "fcl/collide/collide_row.h"
#include "fcl/pair/grow_together.h"
#include "fcl/pair/pose_boxes.h"
#include "fcl/pair/query_scope.h"
#include "thread/of_thread.h"
#include "thread/thread_pool.h"

namespace bocst {
namespace {

/// Poses that a thread takes at a time: enough that reading and walking seldom take turns, few enough to be shared out.
/// Devices want many.
constexpr std::size_t kLeastAtOnce = 256, kMostAtOnce = 4096;
/// A thread starts in the time that so many poses take whose bounding boxes are apart.
constexpr std::size_t kPosesForThread = 4096;

enum class LastRow { kChecked, kIgnored };

template <typename S>
class Poses {
 public:
  Poses(const S* numbers, MatrixOrder order, LastRow last_row)
      : numbers_(numbers), last_row_(last_row), rows_(order == MatrixOrder::kRows) {}

  const S* numbers(std::size_t k) const { return numbers_ + 16 * k; }
  bool rows() const { return rows_; }

  /// @throws std::invalid_argument unless pose k is rigid.
  fcl::Transform3<S> operator[](std::size_t k) const {
    const auto at = [m = numbers(k), this](int i, int j) { return rows_ ? m[4 * i + j] : m[4 * j + i]; };
    const auto name = [k] { return "pose " + std::to_string(k); };
    if (last_row_ == LastRow::kChecked && !(at(3, 0) == 0 && at(3, 1) == 0 && at(3, 2) == 0 && at(3, 3) == 1)) {
      std::ostringstream row;
      row.precision(std::numeric_limits<S>::max_digits10);
      for (int j = 0; j < 4; ++j) row << at(3, j) << " ";
      throw std::invalid_argument("bocst::collidePoses: " + name() + " has the last row " + row.str() +
                                  "where 0 0 0 1 is expected");
    }
    fcl::Transform3<S> X = fcl::Transform3<S>::Identity();
    S* to = X.matrix().data();  // columns of four
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 3; ++i) to[4 * j + i] = at(i, j);
    }
    if (!fcl_adapter::isSurelyRigid(X)) fcl_adapter::checkPose("collidePoses", name().c_str(), X);
    return X;
  }

 private:
  const S* numbers_;
  LastRow last_row_;
  bool rows_;
};

template <typename S>
void collideSome(const Model<S>& a, const Model<S>& b, const Poses<S>& X_AB, std::size_t begin, std::size_t end,
                 std::uint8_t* hit) {
  struct Scratch {
    std::vector<fcl::Transform3<S>> near_poses;
    std::vector<std::uint32_t> near;
    std::vector<std::uint8_t> hits;
  };
  auto& [near_poses, near, hits] = thread::ofThread<Scratch>();
  near.resize(std::max(near.size(), end - begin));
  hits.resize(near.size());
  std::fill(hit + begin, hit + end, std::uint8_t{0});
  std::size_t count;
  {
    const fcl_adapter::QueryScope scope(fcl_adapter::treeOf(a), fcl_adapter::treeOf(b));
    count =
        query::findNearPoses(fcl_adapter::boxesOf(a, b), X_AB.numbers(begin), X_AB.rows(), end - begin, near.data());
  }
  near_poses.clear();
  for (std::size_t i = 0; i < count; ++i) near_poses.push_back(X_AB[begin + near[i]]);
  fcl_adapter::collideRow(a, b, near_poses.data(), count, hits.data());
  for (std::size_t i = 0; i < count; ++i) hit[begin + near[i]] = hits[i];
}

template <typename S>
void collideAll(const Model<S>& a, const Model<S>& b, const Poses<S>& X_AB, std::size_t count, std::uint8_t* hit,
                unsigned threads) {
  if (count == 0) return;
  if (X_AB.numbers(0) == nullptr) throw std::invalid_argument("bocst::collidePoses: X_AB is null");
  if (hit == nullptr) throw std::invalid_argument("bocst::collidePoses: hit is null");
  if (fcl_adapter::kindOf<S>("collidePoses", &a, &b) == fcl_adapter::PairKind::kNothing) {
    std::fill(hit, hit + count, std::uint8_t{0});
    return;
  }
  if (threads == 0) {
    const std::size_t most = std::max(1u, std::thread::hardware_concurrency());
    threads = static_cast<unsigned>(std::clamp<std::size_t>(count / kPosesForThread, 1, most));
  }
  const std::size_t shares = fcl_adapter::growsTogether(a, b) ? std::size_t{threads} : std::size_t{8} * threads;
  const std::size_t at_once = std::clamp((count + shares - 1) / shares, kLeastAtOnce, kMostAtOnce);
  const std::size_t rows = (count + at_once - 1) / at_once;
  const auto work = [&](std::size_t row) {
    collideSome(a, b, X_AB, row * at_once, std::min((row + 1) * at_once, count), hit);
    return true;
  };
  thread::ThreadPool(threads, rows).share(rows, work);
}

}  // namespace

template <typename S>
void collidePoses(const Model<S>& a, const Model<S>& b, const fcl::Transform3<S>* X_AB, std::size_t count,
                  std::uint8_t* hit, unsigned threads) {
  static_assert(sizeof(fcl::Transform3<S>) == 16 * sizeof(S), "a pose is its matrix");
  const S* numbers = X_AB == nullptr ? nullptr : X_AB->matrix().data();
  collideAll(a, b, Poses<S>(numbers, MatrixOrder::kColumns, LastRow::kIgnored), count, hit, threads);
}

template <typename S>
void collidePoses(const Model<S>& a, const Model<S>& b, const S* X_AB, MatrixOrder order, std::size_t count,
                  std::uint8_t* hit, unsigned threads) {
  collideAll(a, b, Poses<S>(X_AB, order, LastRow::kChecked), count, hit, threads);
}

#define BOCST_INSTANTIATE(S)                                                                                          \
  template void collidePoses(const Model<S>&, const Model<S>&, const fcl::Transform3<S>*, std::size_t, std::uint8_t*, \
                             unsigned);                                                                               \
  template void collidePoses(const Model<S>&, const Model<S>&, const S*, MatrixOrder, std::size_t, std::uint8_t*,     \
                             unsigned);
BOCST_INSTANTIATE(float)
BOCST_INSTANTIATE(double)
#undef BOCST_INSTANTIATE

}  // namespace bocst
