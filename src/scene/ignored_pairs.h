// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <bocst/scene.h>

#include <new>
#include <unordered_map>
#include <unordered_set>

namespace bocst::scene {

/// The pairs of objects that are allowed to touch.
class IgnoredPairs {
 public:
  using Partners = std::unordered_set<Id>;

  void set(Id a, Id b, bool ignored) {
    if (ignored) {
      try {
        partners_[a].insert(b);
        partners_[b].insert(a);
        return;
      } catch (const std::bad_alloc&) {
        erase(a, b);
        erase(b, a);
        throw;
      }
    }
    erase(a, b);
    erase(b, a);
  }

  /// Forgets all pairs of an object.
  void remove(Id object) {
    for (const Id other : of(object)) erase(other, object);
    partners_.erase(object);
  }

  /// The objects that this object may touch.
  const Partners& of(Id object) const {
    static const Partners none;
    const auto found = partners_.find(object);
    return found != partners_.end() ? found->second : none;
  }
  bool contains(Id a, Id b) const { return of(a).count(b) != 0; }

 private:
  void erase(Id from, Id what) {
    const auto found = partners_.find(from);
    if (found == partners_.end()) return;
    found->second.erase(what);
    if (found->second.empty()) partners_.erase(found);
  }

  std::unordered_map<Id, Partners> partners_;  // each pair twice
};

}  // namespace bocst::scene
