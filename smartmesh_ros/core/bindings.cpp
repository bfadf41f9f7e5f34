// What Python sees of the core. Arguments are checked here or by nanobind's types; nothing else in the core knows Python.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <stdexcept>
#include <string>

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/tuple.h>

#include "alignment.h"
#include "plugin.h"
#include "test_entries.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace smartmesh {
namespace {

using Floats2 = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Floats3 = nb::ndarray<const float, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Doubles2 = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Doubles3 = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Whole2 = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Bytes2 = nb::ndarray<const std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Slots = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using States = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
constexpr int MOST_SLOTS = 1 << 24;
using Bytes3 = nb::ndarray<const std::uint8_t, nb::ndim<3>, nb::c_contig, nb::device::cpu>;


Mode mode_of(int number) {
  if (number < 0 || number > 3) throw std::invalid_argument("the mode must be one of Mode");
  return static_cast<Mode>(number);
}

// A height map's arrays, which stay alive with it.
struct Grid {
  HeightGrid grid;
  Floats2 heights, offsets;
  Floats3 velocities;
  Bytes3 clocks;

  Grid(Floats2 heights_rc, Floats3 velocities_krc, Floats2 offsets_rc, Bytes3 clocks_rc)
      : heights(heights_rc), offsets(offsets_rc), velocities(velocities_krc), clocks(clocks_rc) {
    const std::size_t rows = heights.shape(0), columns = heights.shape(1);
    const std::size_t block_rows = (rows + 63) >> BLOCK_SHIFT, block_columns = (columns + 63) >> BLOCK_SHIFT;
    if (rows < 2 || columns < 2 || rows > (1u << 24) || columns > (1u << 24))
      throw std::invalid_argument("a grid has 2 to 2^24 rows and columns");
    if (offsets.shape(0) != rows || offsets.shape(1) != columns)
      throw std::invalid_argument("offsets must have the shape of heights");
    if (velocities.shape(0) != KEPT || velocities.shape(1) != rows || velocities.shape(2) != columns)
      throw std::invalid_argument("velocities must have the shape (3, rows, columns)");
    if (clocks.shape(0) != block_rows || clocks.shape(1) != block_columns || clocks.shape(2) != sizeof(Clock))
      throw std::invalid_argument("clocks must be records of CLOCK, one for each block of 64 x 64 samples");
    check_alignment(heights.data(), sizeof(float)), check_alignment(offsets.data(), sizeof(float));
    check_alignment(velocities.data(), sizeof(float)), check_alignment(clocks.data(), alignof(Clock));
    grid.heights = heights.data(), grid.velocities = velocities.data(), grid.offsets = offsets.data();
    grid.clocks = reinterpret_cast<const Clock*>(clocks.data());
    grid.rows = static_cast<int>(rows), grid.columns = static_cast<int>(columns);
    grid.block_columns = static_cast<int>(block_columns);
  }

  void place(double x, double y, double z, double yaw, double resolution) {
    if (!(resolution > 0.0 && std::isfinite(resolution)))
      throw std::invalid_argument("the resolution must be above zero and finite");
    if (!std::isfinite(x + y + z + yaw)) throw std::invalid_argument("the place of a grid must be finite");
    grid.x = x, grid.y = y, grid.z = z, grid.yaw = yaw, grid.resolution = resolution;
  }
  void move(double time, double interval, double x, double y, double spin) {
    if (!std::isfinite(time + interval + x + y + spin)) throw std::invalid_argument("the motion of a grid must be finite");
    grid.track = {time, interval, x, y, spin};
  }
  void set_motion(int mode, double max_velocity, double settle, double noise, double shown) {
    grid.mode = mode_of(mode);
    grid.max_velocity = max_velocity, grid.settle = settle, grid.noise = noise, grid.shown = shown;
    ++grid.revision;
  }
};

// A triangle mesh's arrays, which stay alive with it.
struct Mesh {
  MeshSurface surface;
  Doubles2 now;
  Doubles3 velocities;
  Bytes2 clocks;
  Whole2 triangles;

  Mesh(Doubles2 now_3v, Doubles3 velocities_k3v, Bytes2 clocks_1, Whole2 triangles_t3)
      : now(now_3v), velocities(velocities_k3v), clocks(clocks_1), triangles(triangles_t3) {
    const std::size_t count = now.shape(1), most = 1u << 28;
    if (now.shape(0) != 3 || count < 3 || count > most)
      throw std::invalid_argument("vertices must have the shape (3, V), with 3 to 2^28 vertices");
    if (velocities.shape(0) != KEPT || velocities.shape(1) != 3 || velocities.shape(2) != count)
      throw std::invalid_argument("velocities must have the shape (3, 3, V)");
    if (clocks.shape(0) != 1 || clocks.shape(1) != sizeof(Clock))
      throw std::invalid_argument("the clock must be one record of CLOCK");
    if (triangles.shape(1) != 3 || triangles.shape(0) < 1 || triangles.shape(0) > most)
      throw std::invalid_argument("triangles must have the shape (T, 3), with 1 to 2^28 triangles");
    check_alignment(now.data(), sizeof(double)), check_alignment(velocities.data(), sizeof(double));
    check_alignment(clocks.data(), alignof(Clock)), check_alignment(triangles.data(), sizeof(std::int64_t));
    for (std::size_t k = 0; k < triangles.size(); ++k)
      if (triangles.data()[k] < 0 || triangles.data()[k] >= static_cast<std::int64_t>(count))
        throw std::invalid_argument("a triangle uses vertex " + std::to_string(triangles.data()[k]) + "; there are " +
                                    std::to_string(count) + ", counted from 0");
    surface.now = now.data(), surface.velocities = velocities.data();
    surface.clock = reinterpret_cast<const Clock*>(clocks.data());
    surface.triangles = triangles.data(), surface.triangle_count = static_cast<int>(triangles.shape(0));
    surface.vertices = static_cast<int>(count);
    update();
  }

  // Must be called after the arrays have changed.
  void update() {
    for (std::size_t k = 0; k < now.size(); ++k)
      if (!std::isfinite(now.data()[k])) throw std::invalid_argument("vertices must be finite numbers");
    surface.update();
  }
  void set_motion(int mode, double max_velocity) {
    surface.mode = mode_of(mode), surface.max_velocity = max_velocity;
    surface.update();
  }
};

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
  void set_tiles(nb::list parts) {
    std::vector<const HeightGrid*> grids;
    std::vector<const MeshSurface*> meshes;
    nb::list kept;
    for (nb::handle part : parts) {
      if (nb::isinstance<Mesh>(part)) meshes.push_back(&nb::cast<Mesh&>(part).surface);
      else grids.push_back(&nb::cast<Grid&>(part).grid);
      kept.append(part);
    }
    world().surface.set_tiles(grids, meshes);
    tiles = kept;
  }
  // Returns height and vertical velocity of the highest ground at (x, y); ground of meshes above z does not count.
  std::tuple<double, double> ground_at(double x, double y, double z, double time) const {
    if (!std::isfinite(x + y + time) || std::isnan(z)) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
    const GroundPoint ground = world().surface.at(x, y, time, INSTANT, z);
    return {ground.height, ground.velocity};
  }
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
  // Writes the states of the bodies in `slots` (n,) to `states` (S, 13); NaN for bodies that are gone.
  void read(Slots slots, States states) {
    if (states.shape(1) != 13) throw std::invalid_argument("states must have the shape (S, 13)");
    BulletWorld& found = world();
    found.find_objects();
    for (std::size_t k = 0; k < slots.shape(0); ++k) {
      const std::int64_t slot = slots.data()[k];
      if (slot < 0 || slot >= static_cast<std::int64_t>(states.shape(0)))
        throw std::invalid_argument("a slot is not in states");
      double* state = states.data() + 13 * slot;
      if (!found.has(static_cast<int>(slot)) || !found.read(static_cast<int>(slot), state))
        std::fill(state, state + 13, std::numeric_limits<double>::quiet_NaN());
    }
  }
};

}  // namespace
}  // namespace smartmesh

NB_MODULE(_core, m) {
  using namespace smartmesh;
  nb::set_leak_warnings(false);  // a ground may live until the process ends
  add_test_entries(m);
  nb::class_<Grid>(m, "Grid")
      .def(nb::init<Floats2, Floats3, Floats2, Bytes3>(), "heights"_a.noconvert(), "velocities"_a.noconvert(),
           "offsets"_a.noconvert(), "clocks"_a.noconvert())
      .def("place", &Grid::place, "x"_a, "y"_a, "z"_a, "yaw"_a, "resolution"_a)
      .def("move", &Grid::move, "time"_a, "interval"_a, "x"_a, "y"_a, "spin"_a)
      .def("set_motion", &Grid::set_motion, "mode"_a, "max_velocity"_a, "settle"_a, "noise"_a, "shown"_a)
      .def("sample", [](const Grid& g, int row, int column, double time, double ahead) {
        const Sample s = GridReader(g.grid, time, ahead).read(row, column);
        return std::make_tuple(s.height, s.rise);
      });
  nb::class_<Mesh>(m, "Mesh")
      .def(nb::init<Doubles2, Doubles3, Bytes2, Whole2>(), "vertices"_a.noconvert(), "velocities"_a.noconvert(),
           "clock"_a.noconvert(), "triangles"_a.noconvert())
      .def("set_motion", &Mesh::set_motion, "mode"_a, "max_velocity"_a)
      .def("update", &Mesh::update);
  nb::class_<Ground>(m, "Ground")
      .def(nb::init<int>(), "number"_a)
      .def("release", &Ground::release)
      .def_prop_ro("is_there", [](const Ground& g) { return g.find_world() != nullptr; })
      .def("set_tiles", &Ground::set_tiles, "tiles"_a)
      .def("ground_at", &Ground::ground_at, "x"_a, "y"_a, "z"_a, "time"_a)
      .def("attach", &Ground::attach, "slot"_a, "body"_a, "link"_a, "proxy"_a)
      .def("detach", &Ground::detach, "slot"_a)
      .def("enable", &Ground::enable, "flags"_a.noconvert())
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
