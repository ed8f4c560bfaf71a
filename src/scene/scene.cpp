// SPDX-License-Identifier: BSD-3-Clause
#include <bocst/scene.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <map>
#include <mutex>
#include <new>
#include <set>
#include <shared_mutex>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "fcl/adapters/models.h"
#include "fcl/adapters/shapes.h"
#include "fcl/adapters/validate.h"
#include "fcl/pair/grow_together.h"
#include "fcl/queries/scene_pair.h"
#include "log/number_text.h"
#include "scene/distance.h"
#include "scene/edge.h"
#include "scene/sweep.h"
#include "thread/of_thread.h"
#include "thread/sharded_lock.h"
#include "thread/thread_pool.h"

namespace bocst {
namespace {

using scene::Object;
using scene::World;

/// States that one thread looks at in a row: enough of them to be alike, few enough to be shared out.
constexpr std::size_t kStatesAtOnce = 128;
/// An edge seldom has more states. Up to this many, the middles of all parts come first; more are shared out in rows.
constexpr std::size_t kEdge = 512;

std::uint32_t nextScene() {
  static std::atomic<std::uint32_t> last{0};
  return ++last;
}

/// What a thread keeps between queries.
template <typename S>
scene::Sweep<S>& sweepOfThread() {
  return thread::ofThread<scene::Sweep<S>>();
}

/// Likewise: how far the poses of each moving object are from rigid.
std::vector<double>& errorsOfThread() {
  struct Errors {
    std::vector<double> errors;
  };
  return thread::ofThread<Errors>().errors;
}

/// The numbers below `count`, middles before halves.
std::vector<std::size_t> bisected(std::size_t count) {
  std::vector<std::size_t> order;
  std::vector<std::pair<std::size_t, std::size_t>> parts{{0, count}};
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [begin, end] = parts[i];
    if (begin == end) continue;
    const std::size_t middle = begin + (end - begin) / 2;
    order.push_back(middle);
    parts.emplace_back(begin, middle);
    parts.emplace_back(middle + 1, end);
  }
  return order;
}

}  // namespace

template <typename S>
struct Scene<S>::Impl {
  using Goal = typename scene::Sweep<S>::Goal;
  using WorldPtr = std::shared_ptr<const World<S>>;

  // A change holds the mutex, then this lock, both before it changes anything: in a child after fork(), either may
  // throw.
  using Alone = std::lock_guard<thread::ShardedLock>;

  explicit Impl(const SceneOptions& o) : pool(o.threads) {}

  // The world for a query. Made when it is asked for, so that many additions in a row cost little.
  WorldPtr current() const {
    {
      const std::shared_lock<thread::ShardedLock> lock(sharded_lock);
      if (world != nullptr && !is_moving_stale) return world;
    }
    const std::lock_guard<thread::ForkAwareMutex> lock(mutex);
    if (is_moving_stale) {
      change(Alone(sharded_lock), [&](World<S>& w) {
        is_moving_stale = false;
        return w.setMoving(movingObjects(), ignored);
      });
    }
    if (world == nullptr) {
      std::vector<Object<S>> fixed;
      for (const auto& [number, record] : objects) {
        if (!record.moves) fixed.push_back(record.object);
      }
      const auto made = std::make_shared<World<S>>(movingObjects(), fixed, ignored);
      const Alone alone(sharded_lock);
      world = made;
      is_moving_stale = false;
    }
    return world;
  }

  std::vector<Object<S>> movingObjects() const {
    std::vector<Object<S>> all;
    for (const std::uint32_t number : moving_numbers) all.push_back(objects.at(number).object);
    return all;
  }

  // Changes the world that queries see by apply(World&), unless there is none; drops it where that returns false, or
  // where it needs a new hierarchy. To be called after the objects were changed.
  template <typename Apply>
  void change(const Alone&, Apply&& apply) const {
    if (world == nullptr) return;
    try {
      if (world.use_count() > 1) {
        world = std::make_shared<World<S>>(*world);  // queries under way keep the old one
      } else {
        const auto counted = world;  // its decrement makes what ended queries did visible here
      }
      if (apply(*world) && !world->needsRebuild()) return;
    } catch (const std::exception&) {
      // The next query makes another one, or has no memory either.
    }
    world = nullptr;
  }

  // Moving objects came or went, or changed: the next query takes over all of them.
  void changeMoving(const Alone&) { is_moving_stale = true; }

  struct Record {
    std::shared_ptr<Geometry> given;  // by the caller
    Object<S> object;
    bool moves;
  };

  Id add(const char* query, std::shared_ptr<Geometry> geometry, const Transform* X_WG) {
    const std::string name = std::string("bocst::Scene::") + query;
    if (geometry == nullptr) throw std::invalid_argument(name + ": the geometry is null");
    if (X_WG != nullptr) fcl_adapter::checkPose<S>(("Scene::" + std::string(query)).c_str(), "X_WG", *X_WG);
    Object<S> o = objectOf(geometry);
    const std::lock_guard<thread::ForkAwareMutex> lock(mutex);
    const Alone alone(sharded_lock);
    const auto other = with_geometry.find(geometry.get());
    if (other != with_geometry.end())
      o = objects.at(*other->second.begin()).object;  // update() may have come in between
    refuseEmpty(o);
    if (X_WG != nullptr) o.X_WG = *X_WG;
    const std::uint32_t number = next_number++;
    o.id = Id(scene_number, number);
    const auto entry = objects.emplace(number, Record{geometry, std::move(o), X_WG == nullptr}).first;
    const Record& record = entry->second;
    try {
      with_geometry[geometry.get()].insert(number);
      if (record.moves) moving_numbers.push_back(number);
    } catch (const std::bad_alloc&) {
      forgetGeometry(geometry.get(), number);
      objects.erase(entry);
      throw;
    }
    if (record.moves) {
      changeMoving(alone);
    } else {
      change(alone, [&](World<S>& w) { return w.putFixed(record.object, ignored); });
    }
    return Id(scene_number, number);
  }

  // With what is known of the geometry, but without Id and pose.
  Object<S> objectOf(const std::shared_ptr<Geometry>& geometry) const {
    {
      const std::lock_guard<thread::ForkAwareMutex> lock(mutex);
      const auto other = with_geometry.find(geometry.get());
      if (other != with_geometry.end()) return objects.at(*other->second.begin()).object;
    }
    return describe(geometry);
  }

  void forgetGeometry(const Geometry* geometry, std::uint32_t number) {
    const auto others = with_geometry.find(geometry);
    if (others == with_geometry.end()) return;
    others->second.erase(number);
    if (others->second.empty()) with_geometry.erase(others);
  }

  static void checkLimit(const char* query, const char* name, S distance) {
    if (distance >= 0) return;
    throw std::invalid_argument(std::string("bocst::Scene::") + query + ": " + name + " is " +
                                numberText(static_cast<double>(distance)));
  }

  static void refuseEmpty(const Object<S>& o) {
    if (o.model != nullptr && o.model->empty()) throw std::invalid_argument("bocst::Scene: the model is empty");
  }

  static Object<S> describe(const std::shared_ptr<Geometry>& geometry) {
    Object<S> o;
    const Geometry* g = geometry.get();
    const bool is_mesh =
        fcl_adapter::asModel<S>(g) == nullptr && !fcl_adapter::isShape<S>(g) && g->getNodeType() != fcl::GEOM_OCTREE;
    // Models meet each other several times as fast as an fcl::BVHModel.
    o.geometry = is_mesh ? fcl_adapter::modelOfBvh<S>(*g) : geometry;
    o.model = fcl_adapter::asModel<S>(o.geometry.get());
    refuseEmpty(o);
    o.exact = o.model != nullptr && o.model->options().answer == Answer::kExact;
    o.grows_together = o.model != nullptr && fcl_adapter::growsTogether(*o.model, *o.model);
    o.bounds = scene::boundsOf<S>(*o.geometry);
    return o;
  }

  // To be called with the mutex held.
  Record& find(const char* query, Id id) { return const_cast<Record&>(std::as_const(*this).find(query, id)); }
  const Record& find(const char* query, Id id) const {
    const std::string name = std::string("bocst::Scene::") + query;
    if (!id.isValid()) throw std::invalid_argument(name + ": the Id names nothing");
    if (id.scene_ != scene_number) throw std::invalid_argument(name + ": the Id is of another scene");
    const auto found = objects.find(id.number_);
    if (found == objects.end()) {
      throw std::invalid_argument(name + ": object " + std::to_string(id.number_) + " was removed");
    }
    return found->second;
  }

  std::size_t search(const char* query, const Transform* X_WM, std::size_t states, Goal goal, std::uint8_t* hit) const {
    const WorldPtr w = current();
    const std::size_t moving = w->moving.size();
    const bool all_at_once = goal == Goal::kAny && states <= kEdge;
    const std::size_t length = all_at_once ? std::max<std::size_t>(states, 1) : kStatesAtOnce;
    const std::size_t rows = (states + length - 1) / length;
    std::vector<double>& orthogonality_errors = errorsOfThread();
    // Where all are asked, each row is checked just before: then its poses are read from memory once.
    const bool checks_rows = goal == Goal::kAll && rows > 1 && X_WM != nullptr;
    if (!checks_rows) scene::checkPoses<S>(query, X_WM, states, moving, orthogonality_errors);
    if (goal == Goal::kAll) std::fill(hit, hit + states, std::uint8_t{0});
    if (states == 0 || moving == 0) return states;
    if (rows == 1) return sweepOfThread<S>().run(*w, X_WM, states, goal, hit, orthogonality_errors);
    const std::vector<std::size_t> order = goal == Goal::kAny ? bisected(rows) : std::vector<std::size_t>();
    // The first row, in the order of the search, that has a hit; later rows are skipped.
    std::atomic<std::size_t> least{rows};
    std::mutex finding;
    std::size_t found = states;
    pool.share(rows, [&](std::size_t place) {
      if (goal != Goal::kAll && place > least) return false;
      const std::size_t row = order.empty() ? place : order[place];
      const std::size_t begin = row * length, count = std::min(length, states - begin);
      std::uint8_t* hits = hit == nullptr ? nullptr : hit + begin;
      const Transform* X = X_WM + begin * moving;
      std::vector<double>& errors = checks_rows ? errorsOfThread() : orthogonality_errors;
      if (checks_rows) scene::checkPoses<S>(query, X, count, moving, errors, nullptr, begin);
      const std::size_t at = sweepOfThread<S>().run(*w, X, count, goal, hits, errors);
      if (at == count || goal == Goal::kAll) return true;
      const std::lock_guard<std::mutex> lock(finding);
      if (place < least) {
        least = place;
        found = begin + at;
      }
      return false;
    });
    return found;
  }

  void clearances(const char* query, const Transform* X_WM, std::size_t states, S* distances, Pair* nearest,
                  S at_most) const {
    checkLimit(query, "at_most", at_most);
    at_most = std::min(at_most, std::numeric_limits<S>::max());
    const WorldPtr w = current();
    const std::size_t moving = w->moving.size();
    pool.share(states, [&](std::size_t k) {
      const Transform* X = X_WM == nullptr ? nullptr : X_WM + k * moving;
      scene::StateCheck<S>& check = sweepOfThread<S>().check();
      scene::checkPoses<S>(query, X, 1, moving, check.orthogonality_errors, nullptr, k);
      scene::PairAt pair;
      distances[k] = scene::clearance(*w, check, X, at_most, pair);
      const bool has_pair = distances[k] < at_most;
      if (nearest != nullptr) nearest[k] = has_pair ? named(*w, pair) : Pair();
      return true;
    });
  }

  Pair named(const World<S>& w, const scene::PairAt& p) const {
    return {w.moving[p.moving].id, w.object(p.group, p.lane).id};
  }

  mutable thread::ForkAwareMutex mutex;  // of changes
  std::uint32_t next_number = 0;
  std::map<std::uint32_t, Record> objects;                           // in the order of adding
  std::vector<std::uint32_t> moving_numbers;                         // numbers of objects, in the order of adding
  std::map<const Geometry*, std::set<std::uint32_t>> with_geometry;  // the objects that were given it
  scene::IgnoredPairs ignored;
  mutable thread::ShardedLock
      sharded_lock;                         // of `world`; held no longer than it takes to copy the pointer, or a change
  mutable bool is_moving_stale = false;     // `world` has other moving objects; written to under both locks
  mutable std::shared_ptr<World<S>> world;  // null before the first query, and after some changes
  const std::uint32_t scene_number = nextScene();
  mutable thread::ThreadPool pool;
};

template <typename S>
Scene<S>::Scene(const SceneOptions& options) : impl_(std::make_unique<Impl>(options)) {}

template <typename S>
Scene<S>::~Scene() = default;

template <typename S>
Id Scene<S>::addFixed(std::shared_ptr<Geometry> geometry, const Transform& X_WG) {
  return impl_->add("addFixed", std::move(geometry), &X_WG);
}

template <typename S>
Id Scene<S>::addMoving(std::shared_ptr<Geometry> geometry) {
  return impl_->add("addMoving", std::move(geometry), nullptr);
}

template <typename S>
void Scene<S>::remove(Id object) {
  decltype(impl_->objects.extract(0)) removed;  // destroyed without locks: an OcTree takes milliseconds
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  const typename Impl::Alone alone(impl_->sharded_lock);
  impl_->forgetGeometry(impl_->find("remove", object).given.get(), object.number_);
  removed = impl_->objects.extract(object.number_);
  const bool moves = removed.mapped().moves;
  impl_->ignored.remove(object);
  if (moves) {
    auto& moving = impl_->moving_numbers;
    moving.erase(std::find(moving.begin(), moving.end(), object.number_));
    impl_->changeMoving(alone);
    impl_->change(alone, [&](World<S>& w) {
      w.releaseMoving(object);
      return true;
    });
  } else {
    impl_->change(alone, [&](World<S>& w) {
      w.removeFixed(object);
      return true;
    });
  }
}

template <typename S>
void Scene<S>::setPose(Id fixed, const Transform& X_WG) {
  fcl_adapter::checkPose<S>("Scene::setPose", "X_WG", X_WG);
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  const typename Impl::Alone alone(impl_->sharded_lock);
  typename Impl::Record& record = impl_->find("setPose", fixed);
  if (record.moves) {
    throw std::invalid_argument("bocst::Scene::setPose: the object moves; its pose comes with each state");
  }
  record.object.X_WG = X_WG;
  impl_->change(alone, [&](World<S>& w) { return w.putFixed(record.object, impl_->ignored); });
}

template <typename S>
void Scene<S>::ignore(Id a, Id b, bool ignored) {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  const typename Impl::Alone alone(impl_->sharded_lock);
  impl_->find("ignore", a);
  impl_->find("ignore", b);
  if (a == b) throw std::invalid_argument("bocst::Scene::ignore: both Ids name the same object");
  impl_->ignored.set(a, b, ignored);
  impl_->change(alone, [&](World<S>& w) {
    w.setIgnored(a, b, ignored);
    return true;
  });
}

template <typename S>
void Scene<S>::update(Id object) {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  const std::shared_ptr<Geometry> geometry = impl_->find("update", object).given;
  const Object<S> updated = Impl::describe(geometry);
  const typename Impl::Alone alone(impl_->sharded_lock);
  bool any_moves = false;
  for (const std::uint32_t number : impl_->with_geometry.at(geometry.get())) {
    typename Impl::Record& record = impl_->objects.at(number);
    const Object<S> before = std::exchange(record.object, updated);
    record.object.id = before.id;
    record.object.X_WG = before.X_WG;
    any_moves |= record.moves;
    if (record.moves) continue;
    impl_->change(alone, [&, &object = record.object](World<S>& w) { return w.putFixed(object, impl_->ignored); });
  }
  if (any_moves) impl_->changeMoving(alone);
}

template <typename S>
void Scene<S>::buildTrees() {
  std::vector<std::pair<std::size_t, std::shared_ptr<Geometry>>> models;  // with the numbers of their triangles
  {
    const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
    for (const auto& [given, numbers] : impl_->with_geometry) {
      const Object<S>& object = impl_->objects.at(*numbers.begin()).object;
      if (!object.exact || object.model->empty()) continue;
      const std::shared_ptr<const Mesh> mesh = object.model->mesh();
      models.emplace_back(mesh != nullptr ? mesh->triangleCount() : 0, object.geometry);
    }
  }
  // The longest build first, so that no thread ends alone with it.
  std::sort(models.rbegin(), models.rend());
  impl_->pool.share(models.size(), [&](std::size_t i) {
    static_cast<Model<S>&>(*models[i].second).buildTree();
    return true;
  });
  impl_->current();
}

template <typename S>
bool Scene<S>::collides(const Transform* X_WM, Pair* pair) const {
  const auto w = impl_->current();
  scene::StateCheck<S>& check = sweepOfThread<S>().check();
  scene::checkPoses<S>("collides", X_WM, 1, w->moving.size(), check.orthogonality_errors);
  check.start(*w);
  if (!check.runAll(X_WM, nullptr)) return false;
  if (pair != nullptr) *pair = impl_->named(*w, check.last());
  return true;
}

template <typename S>
std::size_t Scene<S>::firstCollision(const Transform* X_WM, std::size_t states) const {
  return impl_->search("firstCollision", X_WM, states, Impl::Goal::kFirst, nullptr);
}

template <typename S>
bool Scene<S>::anyCollision(const Transform* X_WM, std::size_t states, std::size_t* where) const {
  const std::size_t found = impl_->search("anyCollision", X_WM, states, Impl::Goal::kAny, nullptr);
  if (where != nullptr && found != states) *where = found;
  return found != states;
}

template <typename S>
void Scene<S>::collisions(const Transform* X_WM, std::size_t states, std::uint8_t* hit) const {
  if (states != 0 && hit == nullptr) throw std::invalid_argument("bocst::Scene::collisions: hit is null");
  impl_->search("collisions", X_WM, states, Impl::Goal::kAll, hit);
}

template <typename S>
S Scene<S>::clearance(const Transform* X_WM, Pair* nearest, S at_most) const {
  S distance;
  impl_->clearances("clearance", X_WM, 1, &distance, nearest, at_most);
  return distance;
}

template <typename S>
void Scene<S>::clearances(const Transform* X_WM, std::size_t states, S* distances, Pair* nearest, S at_most) const {
  if (states != 0 && distances == nullptr) {
    throw std::invalid_argument("bocst::Scene::clearances: distances is null");
  }
  impl_->clearances("clearances", X_WM, states, distances, nearest, at_most);
}

template <typename S>
std::vector<Pair> Scene<S>::collidingPairs(const Transform* X_WM) const {
  const auto w = impl_->current();
  scene::StateCheck<S>& check = sweepOfThread<S>().check();
  scene::checkPoses<S>("collidingPairs", X_WM, 1, w->moving.size(), check.orthogonality_errors);
  check.start(*w);
  std::vector<scene::PairAt> touching;
  check.listTouching(X_WM, touching);
  std::vector<Pair> pairs;
  for (const scene::PairAt& p : touching) pairs.push_back(impl_->named(*w, p));
  std::sort(pairs.begin(), pairs.end(),
            [](const Pair& p, const Pair& q) { return std::tie(p.a, p.b) < std::tie(q.a, q.b); });
  return pairs;
}

template <typename S>
std::vector<PairDistance<S>> Scene<S>::pairsWithin(const Transform* X_WM, S distance) const {
  Impl::checkLimit("pairsWithin", "distance", distance);
  const auto w = impl_->current();
  scene::StateCheck<S>& check = sweepOfThread<S>().check();
  scene::checkPoses<S>("pairsWithin", X_WM, 1, w->moving.size(), check.orthogonality_errors);
  return scene::pairsWithin(*w, check, X_WM, distance);
}

template <typename S>
bool Scene<S>::edgeIsFree(const Transform* X_WM_begin, const Transform* X_WM_end, fcl::CCDMotionType motion) const {
  const auto w = impl_->current();
  scene::StateCheck<S>& check = sweepOfThread<S>().check();
  scene::checkPoses<S>("edgeIsFree", X_WM_begin, 1, w->moving.size(), check.orthogonality_errors, "X_WM_begin");
  scene::checkPoses<S>("edgeIsFree", X_WM_end, 1, w->moving.size(), check.orthogonality_errors, "X_WM_end");
  return scene::edgeIsFree<S>(*w, check, X_WM_begin, X_WM_end, motion);
}

template <typename S>
std::size_t Scene<S>::movingCount() const {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  return impl_->moving_numbers.size();
}

template <typename S>
std::size_t Scene<S>::fixedCount() const {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  return impl_->objects.size() - impl_->moving_numbers.size();
}

template <typename S>
std::size_t Scene<S>::pairCount() const {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  const std::size_t moving = impl_->moving_numbers.size(), fixed = impl_->objects.size() - moving;
  std::size_t ignored_twice = 0;  // two moving objects see each other
  for (const std::uint32_t number : impl_->moving_numbers) {
    for (const Id other : impl_->ignored.of(Id(impl_->scene_number, number))) {
      ignored_twice += impl_->objects.at(other.number_).moves ? 1 : 2;
    }
  }
  return moving * fixed + moving * (moving - 1) / 2 - ignored_twice / 2;
}

template <typename S>
std::size_t Scene<S>::movingIndex(Id moving) const {
  const std::lock_guard<thread::ForkAwareMutex> lock(impl_->mutex);
  if (!impl_->find("movingIndex", moving).moves) {
    throw std::invalid_argument("bocst::Scene::movingIndex: the object is fixed");
  }
  const auto& all = impl_->moving_numbers;
  return static_cast<std::size_t>(std::find(all.begin(), all.end(), moving.number_) - all.begin());
}

template class Scene<float>;
template class Scene<double>;

}  // namespace bocst
