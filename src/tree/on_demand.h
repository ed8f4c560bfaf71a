// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <utility>

#include "thread/published.h"

namespace bocst::tree {

/// Sets the time of last use, unless it is later already.
inline void markUsedAt(std::atomic<std::int64_t>& last_use, std::int64_t now) {
  if (last_use.load(std::memory_order_relaxed) < now) last_use.store(now, std::memory_order_relaxed);
}

/// What queries have paid for something that is built once they have paid its price. Threads: any.
class Rent {
 public:
  void start(std::size_t price) {
    paid_ = 0;
    price_ = price;
  }
  /// Forgets what was paid; the price stays.
  void restart() { paid_ = 0; }
  /// What was paid stays.
  void setPrice(std::size_t price) { price_ = price; }
  /// It was built, or never will be.
  void stop() { price_ = kStopped; }
  bool isStopped() const { return price_.load(std::memory_order_relaxed) == kStopped; }

  void pay(std::size_t amount) const {
    if (!isStopped()) paid_.fetch_add(amount, std::memory_order_relaxed);
  }
  /// True if more was paid than the price.
  bool isDue() const { return paid_.load(std::memory_order_relaxed) > price_.load(std::memory_order_relaxed); }
  /// The part of the price that is not paid yet.
  std::size_t left() const {
    const std::size_t price = price_.load(std::memory_order_relaxed);
    return price - std::min(price, paid_.load(std::memory_order_relaxed));
  }

 private:
  static constexpr std::size_t kStopped = ~std::size_t{0};
  mutable std::atomic<std::size_t> paid_{0};
  std::atomic<std::size_t> price_{kStopped};
};

/// A structure beside a tree's nodes that is built once walks have paid for it, and dropped like a branch. Threads: as
/// Published; times of use, rent and isAwaited() from any thread.
template <typename T>
class OnDemand {
 public:
  const T* seen() const { return value_.seen(); }
  void markUsed(std::int64_t now) const { markUsedAt(last_use_, now); }
  std::int64_t lastUse() const { return last_use_.load(std::memory_order_relaxed); }
  /// Another thread was asked to build it.
  bool isAwaited() const { return is_awaited_.load(std::memory_order_relaxed); }

  // For the writer.

  explicit operator bool() const { return static_cast<bool>(value_); }
  std::size_t bytes() const { return value_ ? value_->bytes() : 0; }
  void set(std::unique_ptr<const T> value) { value_.set(std::move(value)); }
  /// Drops what there is. The price is that of building it.
  void start(std::size_t price) {
    price_ = price;
    drop();
  }
  void drop() {
    value_.reset();
    is_awaited_ = false;
    rent.start(price_);
  }
  /// Another thread builds it. It is due again when walks have paid so many times its price.
  void await(std::size_t times) {
    is_awaited_ = true;
    rent.start(times * price_);
  }
  void leak() { value_.leak(); }

  Rent rent;

 private:
  thread::Published<const T> value_;
  mutable std::atomic<std::int64_t> last_use_{0};
  std::atomic<bool> is_awaited_{false};
  std::size_t price_ = 0;
};

}  // namespace bocst::tree
