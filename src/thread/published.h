// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <atomic>
#include <memory>
#include <utility>

namespace bocst::thread {

/// A value that a writer makes, which readers see once it is complete. One writer at a time; nobody may read while it
/// is reset.
template <typename T>
class Published {
 public:
  void set(std::unique_ptr<T> value) {
    owned_ = std::move(value);
    seen_.store(owned_.get(), std::memory_order_release);
  }
  void reset() {
    seen_.store(nullptr, std::memory_order_relaxed);
    owned_ = nullptr;
  }
  void leak() { static_cast<void>(owned_.release()); }

  /// For readers; null if there is none.
  const T* seen() const { return seen_.load(std::memory_order_acquire); }

  // For the writer.
  explicit operator bool() const { return owned_ != nullptr; }
  T* operator->() const { return owned_.get(); }

 private:
  std::unique_ptr<T> owned_;
  std::atomic<const T*> seen_{nullptr};
};

}  // namespace bocst::thread
