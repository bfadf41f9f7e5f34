// What Python sees of the ground in PyBullet's world.
#include <algorithm>

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bullet/falling.h"
#include "bullet/memory.h"
#include "bullet/moved_bodies.h"
#include "bullet/world.h"
#include "python/soil_binding.h"
#include "step/step_lock.h"

namespace smartmesh {
namespace {

constexpr int MOST_SLOTS = 1 << 24;

// A world that takes no step meanwhile.
struct HeldWorld {
  StepLock lock;
  BulletWorld* world;
  BulletWorld* operator->() const { return world; }
};

std::tuple<double, double, double> tuple_of(const Vec3& v) { return {v.x, v.y, v.z}; }

// The ground in the client of one PyBullet server, by the number that its plugin gave.
struct Ground {
  int number, of_world;
  nb::object tiles, soil;  // which must outlive the world's use of them

  explicit Ground(int of) : number(of) {
    const HeldWorld found{{}, world_of(number)};
    if (found.world == nullptr) refuse("client", "the PyBullet client of this ground is disconnected");
    if (found->owned) refuse("client", "this PyBullet client has a ground already; close that one first");
    found->owned = true;
    found->now.time = 0.0;
    of_world = found->number;
  }
  ~Ground() { release(); }
  Ground(const Ground&) = delete;

  // Takes the ground from all bodies; another ground may then use the client.
  void release() {
    const HeldWorld found = find_world();
    if (found.world != nullptr) found->release();
    number = -1;
  }

  // Returns the world of this ground; null after `resetSimulation` or the end of the client.
  HeldWorld find_world() const {
    HeldWorld found{{}, world_of(number)};
    if (found.world != nullptr && found->number != of_world) found.world = nullptr;
    return found;
  }
  HeldWorld world() const {
    HeldWorld found = find_world();
    if (found.world == nullptr)
      refuse("client", "the PyBullet client was reset or closed: close this ground, and make another");
    return found;
  }
  // Returns what failed in the steps since the last call, empty if nothing did.
  std::string take_fault() {
    const std::exception_ptr fault = world()->take_fault();
    try {
      if (fault) std::rethrow_exception(fault);
    } catch (const std::exception& error) {
      return error.what();
    }
    return {};
  }
  // Lets the bodies stand on the tiles of a terrain, also those that come later.
  void set_tiles(nb::object of) {
    KeptTiles& wanted = nb::cast<KeptTiles&>(of);
    {
      const HeldWorld found = world();
      found->now.terrain = &wanted.tiles;
      found->sleep.wake_all();
    }
    tiles = of;
  }
  void set_soil(nb::object of) {
    Soil* wanted = of.is_none() ? nullptr : &nb::cast<Soil&>(of);
    {
      const HeldWorld found = world();
      found->now.soil = wanted == nullptr ? nullptr : &wanted->soil;
      found->sleep.wake_all();
    }
    soil = of;
  }
  // Returns sinkage [m], area [m^2] and carried force [N] of each part of the body in a slot that touches the soil.
  auto on_soil(int slot) {
    std::vector<std::array<double, 3>> sums;
    if (const HeldWorld found = world(); found->attached.has(slot) && found->now.soil != nullptr) {
      for (const auto& [number, part] : found->attached.slots[slot].on_soil)
        if (part.sums.area > 0.0) sums.push_back({part.sums.sinkage, part.sums.area, part.sums.carried});
    }
    return array_of(std::move(sums));
  }
  void attach(int slot, int body, int link, int proxy, const BodyShape& shape) {
    if (slot < 0 || slot > MOST_SLOTS) throw std::invalid_argument("a slot is a number from 0 to 2^24");
    const HeldWorld found = world();
    if (found->attached.has(slot)) throw std::invalid_argument("the slot is used already");
    if (body < 0 || link < -1 || !found->attach(slot, {body, link}, proxy, shape))
      throw std::invalid_argument("PyBullet has no such body, link or proxy");
  }
  void detach(int slot) {
    const HeldWorld found = world();
    found->detach(checked_slot(*found.world, slot));
  }
  // Sets what a slot is; see SlotKind.
  void set_kind(int slot, bool solid, bool own, bool remote) {
    const HeldWorld found = world();
    slot_in(found, slot).kind = {solid, own, remote};
  }
  void keep_apart(int body) {
    if (body < 0 || !world()->keep_apart(body)) throw std::invalid_argument("PyBullet has no such body");
  }
  // Sets when bodies fall asleep and wake; see SleepRules.
  void set_sleep(double after, double distance, double joint, double change, double noise, double most) {
    if (!(after >= 0.0) || std::isnan(distance + joint + change + noise + most))
      throw std::invalid_argument("the rules of sleep must be numbers, and the time not negative");
    world()->sleep.set_rules({after, distance, joint, {change, noise, most}});
  }
  void wake(int slot) {
    const HeldWorld found = world();
    found->attached.find_objects();
    found->wake(checked_slot(*found.world, slot));
  }
  bool is_asleep(int slot) const {
    const HeldWorld found = world();
    return slot_in(found, slot).rest.asleep;
  }
  // Sets the time [s] and duration [s] of the next step. Returns false and sets nothing if somebody has to look before:
  // the client is gone, a step failed, bodies are gone, or the last step had another duration.
  bool begin(double start, double duration) {
    const HeldWorld found = find_world();
    if (found.world == nullptr || found->has_fault() || found->attached.has_gone() || found->now.duration != duration)
      return false;
    found->now.time = start;
    return true;
  }
  bool is_ground(int body) const {
    const HeldWorld found = find_world();
    return found.world != nullptr && found->is_ground(body);
  }
  // Returns the slots of bodies that began to fall, and of those that are lost; see bullet/falling.h.
  auto check_falls(double time, double depth) {
    const HeldWorld held = world();
    return smartmesh::check_falls(held->now, held->attached, finite(time, "the time"), depth);
  }
  auto last_ground(int slot) const {
    const HeldWorld found = world();
    return tuple_of(slot_in(found, slot).last_ground);
  }
  // Moves the surface of the body in a slot about an axis (3,) at a `speed` [m/s]; see Belt.
  void drive(int slot, std::tuple<double, double, double> axis, double speed) {
    const auto [x, y, z] = axis;
    const HeldWorld found = world();
    checked_slot(*found.world, slot);
    if (!std::isfinite(x + y + z + speed)) throw std::invalid_argument("the axis and the speed must be finite");
    const double size = norm2({x, y, z});
    if (!(size > 0.0 && std::isfinite(size))) throw std::invalid_argument("the axis must have a length");
    found->drive(slot, {{x, y, z}, speed});
  }
  // Returns what the `slots` (n,) know of the past, (n, 23) as SlotMemory.
  auto memory_of(Slots slots) const {
    std::vector<SlotMemory> rows;
    {
      const HeldWorld held = world();
      for (const std::int64_t slot : slots) rows.push_back(slot_in(held, slot));
    }
    return array_of(std::move(rows));
  }
  void recall(Slots slots, Rows<const SlotMemory> memory) {
    const HeldWorld held = world();
    check_counts(slots.size(), memory);
    for (std::size_t k = 0; k < slots.size(); ++k) static_cast<SlotMemory&>(slot_in(held, slots[k])) = memory[k];
    held->sleep.take_gravity();
  }
  // Returns what a slot knows of its parts on the soil (n,), and takes it over.
  auto parts_memory(int slot) const {
    std::vector<double> found;
    {
      const HeldWorld held = world();
      found = smartmesh::parts_memory(slot_in(held, slot), held->now.soil);
    }
    return array_of(std::move(found));
  }
  void recall_parts(int slot, Doubles1 numbers) {
    const HeldWorld held = world();
    held->attached.find_objects();
    if (!smartmesh::recall_parts(slot_in(held, slot), held->now.soil, numbers.data(), numbers.size()))
      throw std::invalid_argument("the parts on the soil are those of another body");
  }
  static int checked_slot(const BulletWorld& held, std::int64_t slot) {
    if (slot < 0 || slot > MOST_SLOTS || !held.attached.has(static_cast<int>(slot)))
      throw std::invalid_argument("no attached body has this slot");
    return static_cast<int>(slot);
  }
  static Slot& slot_in(const HeldWorld& held, std::int64_t slot) {
    return held->attached.slots[checked_slot(*held.world, slot)];
  }
  // Writes the states of the bodies in `slots` (n,) to `states` (S, 13); NaN for bodies that are gone.
  void read(Slots slots, Rows<BodyState> states) {
    const HeldWorld found = world();
    found->attached.find_objects();
    for (const std::int64_t slot : slots_below(slots, states.size()))
      if (!found->attached.has(static_cast<int>(slot)) || !found->attached.slots[slot].read(states[slot]))
        std::fill_n(states.numbers() + BODY_COLUMNS * slot, BODY_COLUMNS, NONE);
  }
  // Returns the point [m], the normal and the depth [m] of the deepest contact of a slot now, None if there is none.
  auto deepest_contact(int slot) {
    const HeldWorld held = world();
    held->attached.find_objects();
    const auto found = held->narrowphase.deepest_contact(slot_in(held, slot));
    return found ? std::optional(std::tuple(tuple_of(found->point), tuple_of(found->normal), -found->distance))
                 : std::nullopt;
  }
};

// A number of the world that Python may read and write.
template <auto member>
void add_number(nb::class_<Ground>& ground, const char* name) {
  using Number = std::remove_reference_t<decltype(std::declval<Instant&>().*member)>;
  ground.def_prop_rw(
      name, [](const Ground& g) { return g.world()->now.*member; },
      [](Ground& g, Number value) { g.world()->now.*member = value; });
}

}  // namespace

void add_ground(nb::module_& m) {
  nb::class_<Ground> ground(m, "Ground");
  ground.def("set_soil", &Ground::set_soil, "soil"_a.none())
      .def("on_soil", &Ground::on_soil, "slot"_a)
      .def(nb::init<int>(), "number"_a)
      .def_ro("number", &Ground::number)
      .def("release", &Ground::release)
      .def_prop_ro("is_there", [](const Ground& g) { return g.find_world().world != nullptr; })
      .def("take_fault", &Ground::take_fault)
      .def("set_tiles", &Ground::set_tiles, "tiles"_a)
      .def("set_kind", &Ground::set_kind, "slot"_a, "solid"_a, "own"_a, "remote"_a)
      .def("attach", &Ground::attach, "slot"_a, "body"_a, "link"_a, "proxy"_a, "shape"_a)
      .def("detach", &Ground::detach, "slot"_a)
      .def("set_sleep", &Ground::set_sleep, "after"_a, "distance"_a, "joint"_a, "change"_a, "noise"_a, "most"_a)
      .def("wake", &Ground::wake, "slot"_a)
      .def("wake_all", [](const Ground& g) { g.world()->sleep.wake_all(); })
      .def("begin", &Ground::begin, "time"_a, "duration"_a)
      .def("update", [](const Ground& g) { g.world()->update(); })
      .def_prop_ro("rescues", [](const Ground& g) { return g.world()->rescues; })
      .def("check_falls", &Ground::check_falls, "time"_a, "depth"_a)
      .def(
          "find_falling",
          [](const Ground& g) { return g.world()->attached.where([](const Slot& slot) { return slot.falls != 0.0; }); })
      .def("last_ground", &Ground::last_ground, "slot"_a)
      .def("find_below",
           [](const Ground& g) {
             const HeldWorld held = g.world();
             return find_below(held->now, held->attached);
           })
      .def("find_nowhere", [](const Ground& g, double farthest) { return find_nowhere(g.world()->attached, farthest); })
      .def("find_gone", [](const Ground& g, bool of_proxies) { return g.world()->attached.find_gone(of_proxies); })
      .def("is_ground", &Ground::is_ground, "body"_a)
      .def("is_asleep", &Ground::is_asleep, "slot"_a)
      .def("find_asleep", [](const Ground& g) { return g.world()->attached.list_asleep(); })
      .def("drive", &Ground::drive, "slot"_a, "axis"_a, "speed"_a)
      .def("memory_of", &Ground::memory_of, "slots"_a)
      .def("recall", &Ground::recall, "slots"_a, "memory"_a)
      .def("parts_memory", &Ground::parts_memory, "slot"_a)
      .def("recall_parts", &Ground::recall_parts, "slot"_a, "numbers"_a)
      .def("forget", [](const Ground& g) { g.world()->forget(); })
      .def("keep_apart", &Ground::keep_apart, "body"_a)
      .def("deepest_contact", &Ground::deepest_contact, "slot"_a)
      .def("read", &Ground::read, "slots"_a, "states"_a);
  add_number<&Instant::time>(ground, "time");
  add_number<&Instant::duration>(ground, "duration");
  add_number<&Instant::margin>(ground, "margin");
  add_number<&Instant::drawn>(ground, "drawn");
}

}  // namespace smartmesh
