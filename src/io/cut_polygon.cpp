// SPDX-License-Identifier: BSD-3-Clause
#include "io/cut_polygon.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <set>
#include <utility>

namespace bocst::io {

int orientation(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  const auto sign = [](double x) { return (x > 0) - (x < 0); };
  const double left = (b.x() - a.x()) * (c.y() - a.y());
  const double right = (b.y() - a.y()) * (c.x() - a.x());
  // Six roundings of at most 2^-53 each; nothing has underflowed when the products are of normal size.
  const double size = std::abs(left) + std::abs(right);
  if (size > 1e-280 && std::abs(left - right) > 8e-16 * size) return sign(left - right);

  // The sum of the six products without rounding: each is two doubles, added into an expansion of disjoint doubles.
  const double factors[6][2] = {{a.x(), b.y()},  {-a.x(), c.y()}, {b.x(), c.y()},
                                {-b.x(), a.y()}, {c.x(), a.y()},  {-c.x(), b.y()}};
  double sum[12];
  int terms = 0;
  for (const auto& [u, v] : factors) {
    const double product = u * v;
    for (double carry : {std::fma(u, v, -product), product}) {
      for (int i = 0; i < terms; ++i) {
        const double s = carry + sum[i];
        const double part = s - carry;
        sum[i] = (carry - (s - part)) + (sum[i] - part);
        carry = s;
      }
      sum[terms++] = carry;
    }
  }
  while (terms > 1 && sum[terms - 1] == 0) --terms;
  return sign(sum[terms - 1]);
}

namespace {

using Corner = std::uint32_t;

/// The ring of corners not cut off yet. Edge i goes from corner i to the next one; the inside is on its left.
class Cutter {
 public:
  explicit Cutter(const std::vector<Eigen::Vector2d>& flat)
      : flat_(flat), next_(flat.size()), prev_(flat.size()), alive_(flat.size(), true), size_(flat.size()) {
    triangles_.reserve(flat.size());
    const auto n = static_cast<Corner>(flat.size());
    for (Corner i = 0; i < n; ++i) {
      next_[i] = i + 1 < n ? i + 1 : 0;
      prev_[next_[i]] = i;
    }
  }

  std::vector<CornerTriple> cut();

 private:
  /// Goes over the corners from left to right and cuts off what lies behind (Hertel and Mehlhorn 1983).
  class Sweep;

  int turn(Corner a, Corner b, Corner c) const { return orientation(flat_[a], flat_[b], flat_[c]); }

  void clip(Corner i) {
    triangles_.push_back({prev_[i], i, next_[i]});
    next_[prev_[i]] = next_[i];
    prev_[next_[i]] = prev_[i];
    alive_[i] = false;
    --size_;
  }

  /// Corners on a line with both neighbours: repeated ones, those on an edge, tips of spikes and of slits.
  void dropFlatCorners() {
    std::vector<Corner> todo(flat_.size());
    for (Corner i = 0; i < todo.size(); ++i) todo[i] = static_cast<Corner>(todo.size()) - 1 - i;
    while (!todo.empty() && size_ > 2) {
      const Corner i = todo.back();
      todo.pop_back();
      if (!alive_[i] || turn(prev_[i], i, next_[i]) != 0) continue;
      clip(i);
      todo.push_back(next_[i]);
      todo.push_back(prev_[i]);
    }
  }

  /// True if the triangle at corner i may be cut off: it does not turn right, and no other corner lies in it.
  bool isEar(Corner i, std::size_t& effort) const {
    const Corner a = prev_[i];
    const Corner c = next_[i];
    if (turn(a, i, c) < 0) return false;
    for (Corner k = next_[c]; k != a && effort > 0; k = next_[k]) {
      --effort;
      const Eigen::Vector2d& p = flat_[k];
      if (p == flat_[a] || p == flat_[i] || p == flat_[c]) continue;
      if (turn(a, i, k) >= 0 && turn(i, c, k) >= 0 && turn(c, a, k) >= 0) return false;
    }
    return true;
  }

  /// For polygons that cross or nearly cross themselves, where the sweep gives up. Where nothing is an ear, or when the
  /// effort is spent (the search is quadratic), any corner is as good as another.
  void clipEars() {
    std::size_t effort = 8 * size_ * static_cast<std::size_t>(1 + std::log2(size_));
    Corner i = 0;
    while (!alive_[i]) ++i;
    std::size_t refused = 0;
    while (size_ > 2) {
      if (effort > 0) --effort;
      const bool cut = size_ == 3 || refused >= size_ || effort == 0 || isEar(i, effort);
      if (cut) clip(i);
      refused = cut ? 0 : refused + 1;
      i = next_[i];
    }
  }

  const std::vector<Eigen::Vector2d>& flat_;
  std::vector<Corner> next_;
  std::vector<Corner> prev_;
  std::vector<bool> alive_;
  std::size_t size_;
  std::vector<CornerTriple> triangles_;
};

class Cutter::Sweep {
 public:
  explicit Sweep(Cutter& cutter) : c_(cutter), owner_(cutter.flat_.size(), nullptr), intervals_(Below{this}) {
    storage_.reserve(cutter.size_);  // pointers to intervals stay good
    links_.reserve(2 * cutter.size_);
  }

  /// False when the polygon turns out to cross itself.
  bool run() {
    const std::size_t expected = c_.triangles_.size() + c_.size_ - 2;
    std::vector<Corner> events;
    events.reserve(c_.size_);
    for (Corner i = 0; i < c_.alive_.size(); ++i) {
      if (c_.alive_[i]) events.push_back(i);
    }
    std::sort(events.begin(), events.end(), [this](Corner a, Corner b) { return isSooner(a, b); });
    for (const Corner v : events) {
      if (!pass(v)) return false;
    }
    return intervals_.empty() && c_.triangles_.size() == expected;
  }

 private:
  struct Interval;

  /// Intervals do not overlap, so the order of their lower edges is theirs; one without height comes first.
  struct Below {
    using is_transparent = void;
    const Sweep* sweep;
    bool operator()(const Interval* a, const Interval* b) const {
      const int order = sweep->height(a->lower, b->lower);
      return order != 0 ? order < 0 : sweep->height(a->upper, b->upper) < 0;
    }
    bool operator()(Corner edge, const Interval* b) const { return sweep->height(edge, b->lower) < 0; }
  };
  using Intervals = std::multiset<Interval*, Below>;

  /// The inside along the sweep line between two edges, and the corners behind it that are not cut off yet, from the
  /// lower edge to the upper one: no two neighbours of a corner of this chain see each other through the inside.
  struct Interval {
    Corner lower;
    Corner upper;
    int first;  // links of the chain
    int last;
    int newest;  // the rightmost one
    Intervals::iterator place;
  };
  struct Link {
    Corner corner;
    int prev;
    int next;
  };

  bool before(Corner a, Corner b) const {
    const Eigen::Vector2d& p = c_.flat_[a];
    const Eigen::Vector2d& q = c_.flat_[b];
    return p.x() < q.x() || (p.x() == q.x() && p.y() < q.y());
  }

  /// At one place edges end before others begin, and what begins around another begins before it.
  bool isSooner(Corner a, Corner b) const {
    if (before(a, b) || before(b, a)) return before(a, b);
    const int ending_a = before(c_.prev_[a], a) + before(c_.next_[a], a);
    const int ending_b = before(c_.prev_[b], b) + before(c_.next_[b], b);
    if (ending_a != ending_b) return ending_a > ending_b;
    if (ending_a != 0) return a < b;
    const bool convex_a = c_.turn(c_.prev_[a], a, c_.next_[a]) > 0;
    const bool convex_b = c_.turn(c_.prev_[b], b, c_.next_[b]) > 0;
    const int low = c_.turn(a, convex_a ? c_.next_[a] : c_.prev_[a], convex_b ? c_.next_[b] : c_.prev_[b]);
    if (low != 0) return low > 0;
    const int high = c_.turn(a, convex_a ? c_.prev_[a] : c_.next_[a], convex_b ? c_.prev_[b] : c_.next_[b]);
    if (high != 0) return high < 0;
    return convex_a != convex_b ? convex_b : a < b;  // a slit of no width, which has the inside on both sides
  }

  /// -1 where edge e lies below edge f along the sweep line, 1 above, 0 where they overlap.
  int height(Corner e, Corner f) const {
    if (e == f) return 0;
    const auto ends = [this](Corner edge) {
      const Corner other = c_.next_[edge];
      return before(edge, other) ? std::pair(edge, other) : std::pair(other, edge);
    };
    const auto [e_left, e_right] = ends(e);
    const auto [f_left, f_right] = ends(f);
    const auto side = [this](Corner a, Corner b, Corner left, Corner right) {
      const int s = c_.turn(a, b, left);
      return s != 0 ? s : c_.turn(a, b, right);
    };
    return before(f_left, e_left) ? side(f_left, f_right, e_left, e_right) : -side(e_left, e_right, f_left, f_right);
  }

  int newLink(Corner v) {
    links_.push_back({v, -1, -1});
    return static_cast<int>(links_.size()) - 1;
  }

  Interval* newInterval(Corner lower, Corner upper, int link) {
    storage_.push_back({lower, upper, link, link, link, {}});
    owner_[lower] = owner_[upper] = &storage_.back();
    return &storage_.back();
  }

  /// The chain goes on at its upper end, after cutting off what v sees.
  void append(Interval& interval, Corner v) {
    while (interval.first != interval.last) {
      const Link& last = links_[interval.last];
      const Corner inner = links_[last.prev].corner;
      if (c_.turn(v, last.corner, inner) < 0) break;
      c_.triangles_.push_back({v, last.corner, inner});
      interval.last = last.prev;
    }
    const int link = newLink(v);
    links_[link].prev = interval.last;
    links_[interval.last].next = link;
    interval.last = interval.newest = link;
  }

  /// The same at its lower end.
  void prepend(Interval& interval, Corner v) {
    while (interval.first != interval.last) {
      const Link& first = links_[interval.first];
      const Corner inner = links_[first.next].corner;
      if (c_.turn(inner, first.corner, v) < 0) break;
      c_.triangles_.push_back({inner, first.corner, v});
      interval.first = first.next;
    }
    const int link = newLink(v);
    links_[link].next = interval.first;
    links_[interval.first].prev = link;
    interval.first = interval.newest = link;
  }

  bool pass(Corner v) {
    const Corner in = c_.prev_[v];  // the edge that comes to v; v is also the edge that leaves it
    const bool in_ends = before(in, v);
    const bool out_ends = before(c_.next_[v], v);
    const bool convex = c_.turn(in, v, c_.next_[v]) > 0;
    Interval* above = in_ends ? owner_[in] : nullptr;  // an edge from left to right has the inside above it
    Interval* below = out_ends ? owner_[v] : nullptr;
    if (in_ends && (above == nullptr || above->lower != in)) return false;
    if (out_ends && (below == nullptr || below->upper != v)) return false;

    if (in_ends && !out_ends) {
      above->lower = v;
      owner_[v] = above;
      prepend(*above, v);
      return true;
    }
    if (out_ends && !in_ends) {
      below->upper = in;
      owner_[in] = below;
      append(*below, v);
      return true;
    }
    if (!in_ends && convex) {
      Interval* interval = newInterval(v, in, newLink(v));
      interval->place = intervals_.insert(interval);
      return true;
    }
    if (!in_ends) return split(v, in);
    return convex ? end(*above, *below, v) : merge(*above, *below, v);
  }

  bool split(Corner v, Corner in) {
    const auto above = intervals_.upper_bound(in);
    if (above == intervals_.begin()) return false;
    Interval& lower = **std::prev(above);
    if (height(v, lower.upper) > 0) return false;
    const int hub = lower.newest;  // v sees it: nothing lies between them
    const int copy = newLink(links_[hub].corner);
    Interval& upper = *newInterval(v, lower.upper, copy);
    if (hub != lower.last) {
      links_[copy].next = links_[hub].next;
      links_[links_[hub].next].prev = copy;
      upper.last = lower.last;
    }
    lower.last = hub;
    lower.upper = in;
    owner_[in] = &lower;
    upper.place = intervals_.insert(above, &upper);
    append(lower, v);
    prepend(upper, v);
    return true;
  }

  bool end(Interval& interval, const Interval& same, Corner v) {
    if (&interval != &same) return false;
    prepend(interval, v);
    intervals_.erase(interval.place);
    return links_[interval.first].next == interval.last;
  }

  bool merge(Interval& upper, Interval& lower, Corner v) {
    if (&upper == &lower) return false;
    intervals_.erase(upper.place);
    append(lower, v);
    prepend(upper, v);
    const int rest = links_[upper.first].next;
    links_[lower.last].next = rest;
    links_[rest].prev = lower.last;
    lower.last = upper.last;
    lower.upper = upper.upper;
    owner_[upper.upper] = &lower;
    return true;
  }

  Cutter& c_;
  std::vector<Interval*> owner_;  // by edge that crosses the sweep line
  std::vector<Interval> storage_;
  std::vector<Link> links_;
  Intervals intervals_;
};

std::vector<CornerTriple> Cutter::cut() {
  dropFlatCorners();
  const std::size_t before_sweep = triangles_.size();
  if (size_ > 2 && !Sweep(*this).run()) {
    triangles_.resize(before_sweep);
    clipEars();
  }
  return std::move(triangles_);
}

}  // namespace

std::vector<CornerTriple> cutPolygon(const std::vector<Eigen::Vector2d>& flat, std::size_t n) {
  const auto count = static_cast<Corner>(n);
  bool fan = true;
  for (Corner i = 1; i + 1 < count && fan && !flat.empty(); ++i) fan = orientation(flat[0], flat[i], flat[i + 1]) >= 0;
  if (!fan) return Cutter(flat).cut();
  std::vector<CornerTriple> triangles;
  triangles.reserve(n - 2);
  for (Corner i = 1; i + 1 < count; ++i) triangles.push_back({0, i, i + 1});
  return triangles;
}

}  // namespace bocst::io
