// What Python sees of the ground in PyBullet's world.
#include <algorithm>
#include <limits>

#include "bindings.h"
#include "world.h"

namespace smartmesh {
namespace {

constexpr int MOST_SLOTS = 1 << 24;

// The ground in the client of one PyBullet server, by the number that its plugin gave.
struct Ground {
  int number, of_world;
  nb::list tiles;  // keeps the grids and meshes alive

  explicit Ground(int of) : number(of) {
    BulletWorld* found = world_of(number);
    if (found == nullptr) throw std::runtime_error("the PyBullet client of this ground is disconnected");
    if (found->owned) throw std::runtime_error("this PyBullet client has a ground already; close that one first");
    found->owned = true;
    of_world = found->worlds();
  }
  ~Ground() { release(); }
  Ground(const Ground&) = delete;

  // Takes the ground from all bodies; another ground may then use the client.
  void release() {
    if (BulletWorld* found = find_world()) found->release();
    number = -1;
  }

  // Returns the world of this ground; null after `resetSimulation` or the end of the client.
  BulletWorld* find_world() const {
    BulletWorld* found = world_of(number);
    return found != nullptr && found->worlds() == of_world ? found : nullptr;
  }
  BulletWorld& world() const {
    if (BulletWorld* found = find_world()) return *found;
    throw std::runtime_error("the PyBullet client was reset or closed: close this ground, and make another");
  }
  void set_tiles(nb::list parts) { tiles = set_tiles_of(world().surface, parts); }
  void attach(int slot, int body, int link, int proxy) {
    if (slot < 0 || slot > MOST_SLOTS) throw std::invalid_argument("a slot is a number from 0 to 2^24");
    if (world().has(slot)) throw std::invalid_argument("the slot is used already");
    if (body < 0 || link < -1 || !world().attach(slot, body, link, proxy))
      throw std::invalid_argument("PyBullet has no such body, link or proxy");
  }
  void detach(int slot) {
    if (!world().has(slot)) throw std::invalid_argument("no attached body has this slot");
    world().detach(slot);
  }
  // Switches the ground of the slots (S,) on or off.
  void enable(Flags flags) {
    world().find_objects();
    for (std::size_t k = 0; k < flags.shape(0); ++k)
      if (world().has(static_cast<int>(k))) world().enable(static_cast<int>(k), flags.data()[k]);
  }
  // Sets for the slots (S,) whether bodies that sleep in PyBullet are left to sleep when their ground changes.
  void hold(Flags flags) {
    for (std::size_t k = 0; k < flags.shape(0); ++k)
      if (world().has(static_cast<int>(k))) world().hold(static_cast<int>(k), flags.data()[k]);
  }
  // Moves the surface of the body in a slot about an axis (3,) at a `speed` [m/s]; see Belt.
  void drive(int slot, std::tuple<double, double, double> axis, double speed) {
    const auto [x, y, z] = axis;
    if (!world().has(slot)) throw std::invalid_argument("no attached body has this slot");
    if (!std::isfinite(x + y + z + speed)) throw std::invalid_argument("the axis and the speed must be finite");
    const double size = norm2({x, y, z});
    if (!(size > 0.0 && std::isfinite(size))) throw std::invalid_argument("the axis must have a length");
    world().drive(slot, {{x, y, z}, speed});
  }
  // Writes the states of the bodies in `slots` (n,) to `states` (S, 13); NaN for bodies that are gone.
  void read(Slots slots, States states) {
    check_table(states, states.shape(0), BODY_COLUMNS, "states");
    BulletWorld& found = world();
    found.find_objects();
    for (std::size_t k = 0; k < slots.shape(0); ++k) {
      const std::int64_t slot = slots.data()[k];
      if (slot < 0 || slot >= static_cast<std::int64_t>(states.shape(0)))
        throw std::invalid_argument("a slot is not in states");
      if (!found.has(static_cast<int>(slot)) || !found.read(static_cast<int>(slot), rows_of<BodyState>(states)[slot]))
        std::fill_n(states.data() + BODY_COLUMNS * slot, BODY_COLUMNS, std::numeric_limits<double>::quiet_NaN());
    }
  }
};

}  // namespace

void add_ground(nb::module_& m) {
  nb::class_<Ground>(m, "Ground")
      .def(nb::init<int>(), "number"_a)
      .def("release", &Ground::release)
      .def_prop_ro("is_there", [](const Ground& g) { return g.find_world() != nullptr; })
      .def("set_tiles", &Ground::set_tiles, "tiles"_a)
      .def("attach", &Ground::attach, "slot"_a, "body"_a, "link"_a, "proxy"_a)
      .def("detach", &Ground::detach, "slot"_a)
      .def("enable", &Ground::enable, "flags"_a.noconvert())
      .def("drive", &Ground::drive, "slot"_a, "axis"_a, "speed"_a)
      .def("hold", &Ground::hold, "flags"_a.noconvert())
      .def("read", &Ground::read, "slots"_a.noconvert(), "states"_a.noconvert())
      .def_prop_rw(
          "time", [](const Ground& g) { return g.world().time; }, [](Ground& g, double t) { g.world().time = t; })
      .def_prop_rw(
          "duration", [](const Ground& g) { return g.world().duration; },
          [](Ground& g, double t) { g.world().duration = t; })
      .def_prop_rw(
          "margin", [](const Ground& g) { return g.world().margin; }, [](Ground& g, double t) { g.world().margin = t; })
      .def_prop_rw(
          "carry_velocity", [](const Ground& g) { return g.world().carry_velocity; },
          [](Ground& g, bool on) { g.world().carry_velocity = on; });
}

}  // namespace smartmesh
