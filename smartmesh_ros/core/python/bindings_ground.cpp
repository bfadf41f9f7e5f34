// What Python sees of the ground in PyBullet's world.
#include <algorithm>

#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "bullet/falling.h"
#include "bullet/memory.h"
#include "bullet/moved_bodies.h"
#include "bullet/world.h"
#include "python/bindings.h"
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
    SoilInStep* wanted = of.is_none() ? nullptr : &soil_of(of);
    {
      const HeldWorld found = world();
      found->now.soil = wanted;
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
  // Returns what the `slots` (n,) know of the past: (n, 23) as SlotMemory, and numbers of the parts of each on the
  // soil.
  auto memory(Slots slots) const {
    std::vector<SlotMemory> rows;
    std::vector<std::vector<double>> parts;
    {
      const HeldWorld held = world();
      for (const std::int64_t k : slots) {
        const Slot& slot = slot_in(held, k);
        rows.push_back(slot), parts.push_back(parts_memory(slot, held->now.soil));
      }
    }
    nb::list of_parts;
    for (std::vector<double>& each : parts) of_parts.append(array_of(std::move(each)));
    return nb::make_tuple(array_of(std::move(rows)), of_parts);
  }
  void recall(Slots slots, Rows<const SlotMemory> memory, const std::vector<Doubles1>& parts) {
    check_counts(slots.size(), memory);
    if (parts.size() != slots.size()) throw std::invalid_argument("each slot has a list of its parts");
    const HeldWorld held = world();
    held->attached.find_objects();
    for (std::size_t k = 0; k < slots.size(); ++k) {
      Slot& slot = slot_in(held, slots[k]);
      static_cast<SlotMemory&>(slot) = memory[k];
      if (!recall_parts(slot, held->now.soil, parts[k].data(), parts[k].size()))
        throw std::invalid_argument("the parts on the soil are those of another body");
    }
    held->sleep.take_gravity();
  }
  static int checked_slot(const BulletWorld& held, std::int64_t slot) {
    if (!held.attached.has(slot)) throw std::invalid_argument("no attached body has this slot");
    return static_cast<int>(slot);
  }
  static Slot& slot_in(const HeldWorld& held, std::int64_t slot) {
    return held->attached.slots[checked_slot(*held.world, slot)];
  }
  // Returns the states (n, 13) of the bodies in `slots` (n,); NaN in slots that nobody has, and for bodies that are
  // gone.
  auto read(Slots slots) {
    std::vector<BodyState> states(slots.size());
    std::fill_n(reinterpret_cast<double*>(states.data()), BODY_COLUMNS * states.size(), NONE);
    {
      const HeldWorld found = world();
      found->attached.find_objects();
      for (std::size_t k = 0; k < slots.size(); ++k)
        if (found->attached.has(slots[k])) found->attached.slots[slots[k]].read(states[k]);
    }
    return array_of(std::move(states));
  }
  // Returns the attached bodies by slot, (S, 10).
  std::vector<AttachedRow> bodies() const {
    const HeldWorld found = world();
    found->attached.find_objects();
    return found->attached.rows();
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
      .def(
          "has", [](const Ground& g, int slot) { return g.world()->attached.has(slot); }, "slot"_a)
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
      .def_prop_ro("has_gone",
                   [](const Ground& g) {
                     const HeldWorld found = g.find_world();
                     return found.world != nullptr && found->attached.has_gone();
                   })
      .def("find_gone", [](const Ground& g, bool of_proxies) { return g.world()->attached.find_gone(of_proxies); })
      .def("is_ground", &Ground::is_ground, "body"_a)
      .def("is_asleep", &Ground::is_asleep, "slot"_a)
      .def("find_asleep", [](const Ground& g) { return g.world()->attached.list_asleep(); })
      .def("drive", &Ground::drive, "slot"_a, "axis"_a, "speed"_a)
      .def("memory", &Ground::memory, "slots"_a)
      .def("recall", &Ground::recall, "slots"_a, "memory"_a, "parts"_a)
      .def("forget", [](const Ground& g) { g.world()->forget(); })
      .def("keep_apart", &Ground::keep_apart, "body"_a)
      .def("deepest_contact", &Ground::deepest_contact, "slot"_a)
      .def("bodies", [](const Ground& g) { return array_of(g.bodies()); })
      .def("read", &Ground::read, "slots"_a);
  add_number<&Instant::time>(ground, "time");
  add_number<&Instant::duration>(ground, "duration");
  add_number<&Instant::margin>(ground, "margin");
  add_number<&Instant::drawn>(ground, "drawn");
}

}  // namespace smartmesh
