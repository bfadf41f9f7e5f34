// Arrays that Python gives to the core, and the parts of the ground that keep them. Each bindings_*.cpp adds one room.
#pragma once

#include <cmath>
#include <optional>

#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>

#include "ground/deck.h"
#include "ground/tiles.h"
#include "map/map_memory.h"
#include "mesh/mesh_surface.h"
#include "python/tables.h"
#include "step/step_lock.h"

namespace smartmesh {

using namespace nb::literals;

// Raises the package's `InputError`.
[[noreturn]] inline void refuse(const char* reason, const char* message) {
  const nb::object type = nb::module_::import_("smartmesh_ros.errors").attr("InputError");
  PyErr_SetObject(type.ptr(), type(reason, message).ptr());
  throw nb::python_error();
}

using Floats2 = Array<const float, 2>;
using Doubles2 = Array<const double, 2>;
using Place = std::array<double, 2>;  // x, y [m]
using Bytes2 = Array<const std::uint8_t, 2>;
using Triangles = Rows<const std::array<std::int64_t, 3>>;

// Refuses a table that has not the shape (rows, columns).
template <class Table>
void check_shape(const Table& table, std::size_t rows, std::size_t columns, const char* name) {
  if (table.shape(0) != rows || table.shape(1) != columns)
    throw std::invalid_argument(std::string(name) + " must have the shape (" + std::to_string(rows) + ", " +
                                std::to_string(columns) + ")");
}

inline double finite(double value, const char* name) {
  if (!std::isfinite(value)) throw std::invalid_argument(std::string(name) + " must be finite");
  return value;
}

inline Mode mode_of(int number) {
  if (number < 0 || number > static_cast<int>(Mode::Correct))
    throw std::invalid_argument("the mode must be one of Mode");
  return static_cast<Mode>(number);
}

// Refuses a clock whose numbers are no places in its arrays.
inline void check_clock(const Clock& clock) {
  if (clock.newest < 0 || clock.newest >= KEPT || clock.count < 0 || clock.count > INTERVALS_KEPT)
    throw std::invalid_argument("a clock names a velocity or an interval that is not there");
}

// A height map, whose memory Python sees.
struct Grid : MapMemory {
  std::array<std::optional<Floats2>, LAYERS> layers;  // of the material

  Grid(int rows, int columns) : MapMemory(checked(rows), checked(columns)) {}

  static int checked(int count) {
    if (count < 2 || count > 1 << 24) throw std::invalid_argument("a grid has 2 to 2^24 rows and columns");
    return count;
  }
  // Returns the map for an update of a rectangle, after a check of the clocks of the blocks that it touches, which
  // Python may write. To check all of a large map takes longer than a small update.
  HeightGrid& writable(const Region& touched) {
    const Span down = blocks_of({touched.top, touched.bottom}), along = blocks_of({touched.left, touched.right});
    for (std::ptrdiff_t row = down.first; row < down.last; ++row)
      for (std::ptrdiff_t column = along.first; column < along.last; ++column)
        check_clock(grid.clocks[row * grid.block_columns + column]);
    return grid;
  }
  // Notes that Python wrote to the arrays.
  void note_change() { grid.revision = next_revision(); }
  void begin_fusion() {
    const StepLock lock;
    MapMemory::begin_fusion(), note_change();
  }
  void place(double x, double y, double z, double yaw, double resolution) {
    if (!(resolution > 0.0 && std::isfinite(resolution)))
      throw std::invalid_argument("the resolution must be above zero and finite");
    if (!std::isfinite(x + y + z + yaw)) throw std::invalid_argument("the place of a grid must be finite");
    const StepLock lock;
    grid.x = x, grid.y = y, grid.z = z, grid.yaw = yaw, grid.resolution = resolution;
    note_change();
  }
  void move(double time, double interval, double x, double y, double spin) {
    if (!std::isfinite(time + interval + x + y + spin))
      throw std::invalid_argument("the motion of a grid must be finite");
    const StepLock lock;
    grid.track = {time, interval, x, y, spin};
    note_change();
  }
  void show(double instant) {
    if (std::isnan(instant)) throw std::invalid_argument("the instant shown must be a number");
    const StepLock lock;
    grid.show(instant);
  }
  // Sets a layer of the material: samples (rows, columns), or a `uniform` number, NaN = not given.
  void set_layer(int number, std::optional<Floats2> samples, double uniform) {
    if (number < 0 || number >= LAYERS) throw std::invalid_argument("the layer must be one of Layer");
    if (uniform < 0.0) throw std::invalid_argument("the number of a layer is zero or more");
    if (samples)
      check_shape(*samples, static_cast<std::size_t>(grid.rows), static_cast<std::size_t>(grid.columns), "a layer");
    const StepLock lock;
    std::swap(layers[number], samples);  // the one before goes after the lock
    grid.materials.layers[number] = {layers[number] ? layers[number]->data() : nullptr, uniform};
    note_change();
  }
  void set_motion(int mode, double max_velocity, double settle, double noise, double smoothing) {
    const StepLock lock;
    grid.mode = mode_of(mode);
    grid.max_velocity = max_velocity, grid.settle = settle, grid.noise = noise, grid.smoothing = smoothing;
    note_change();
  }
};

// A triangle mesh, whose memory Python sees. Python's triangles stay alive with it.
struct Mesh {
  Triangles triangles;
  MeshSurface surface;

  Mesh(Doubles2 vertices_3v, Triangles triangles_t3)
      : triangles(checked(vertices_3v, triangles_t3)),
        surface(vertices_3v.data(), static_cast<int>(vertices_3v.shape(1)), triangles.numbers(),
                static_cast<int>(triangles.size())) {}

  static const Triangles& checked(const Doubles2& vertices, const Triangles& triangles) {
    const std::size_t count = vertices.shape(1), most = 1u << 28;
    if (vertices.shape(0) != 3 || count < 3 || count > most)
      throw std::invalid_argument("vertices must have the shape (3, V), with 3 to 2^28 vertices");
    if (triangles.size() < 1 || triangles.size() > most)
      throw std::invalid_argument("triangles must have the shape (T, 3), with 1 to 2^28 triangles");
    for (std::size_t k = 0; k < vertices.size(); ++k) finite(vertices.data()[k], "vertices");
    for (const auto& corners : triangles)
      for (const std::int64_t corner : corners)
        if (corner < 0 || corner >= static_cast<std::int64_t>(count))
          throw std::invalid_argument("a triangle uses vertex " + std::to_string(corner) + "; there are " +
                                      std::to_string(count) + ", counted from 0");
    return triangles;
  }

  void set_motion(int mode, double max_velocity, double smoothing) {
    const StepLock lock;
    surface.mode = mode_of(mode), surface.max_velocity = max_velocity, surface.smoothing = smoothing;
    surface.update();
  }
};

// A deck of Python; `tiles` keeps its grids and meshes alive.
struct DeckOfTiles {
  Deck deck;
  nb::list tiles;
};

// Sets the tiles of a terrain. Returns what must outlive them: a copy of the list, which Python may change.
inline nb::list set_tiles_of(Tiles& terrain, const nb::list& tiles) {
  std::vector<HeightGrid*> grids;
  std::vector<MeshSurface*> meshes;
  std::vector<Deck*> decks;
  nb::list kept;
  for (nb::handle tile : tiles) {
    if (nb::isinstance<Mesh>(tile))
      meshes.push_back(&nb::cast<Mesh&>(tile).surface);
    else if (nb::isinstance<DeckOfTiles>(tile))
      decks.push_back(&nb::cast<DeckOfTiles&>(tile).deck);
    else
      grids.push_back(&nb::cast<Grid&>(tile).grid);
    kept.append(tile);
  }
  const StepLock lock;
  terrain.set_all(grids, meshes, decks);
  return kept;
}

// The tiles of a terrain of Python, which `kept` keeps alive.
struct KeptTiles {
  Tiles tiles;
  nb::list kept;

  explicit KeptTiles(const nb::list& parts) { set(parts); }
  void set(const nb::list& parts) { kept = set_tiles_of(tiles, parts); }
  // Returns a reader at `time` [s] for `count` points.
  GroundReader reader(double time, std::size_t count) const {
    GroundReader made = tiles.reader(finite(time, "the time"), INSTANT);
    made.prepare(count);
    return made;
  }
};

class SoilInStep;
// Returns the soil of an object of Python; throws for any other.
SoilInStep& soil_of(nb::handle soil);

// Each adds what its room needs.
void add_queries(nb::module_& m);
void add_updates(nb::module_& m);
void add_soil(nb::module_& m);
void add_bodies(nb::module_& m);
void add_patches(nb::module_& m);
void add_rows(nb::module_& m);
void add_contacts(nb::module_& m);
void add_decks(nb::module_& m);
void add_ground(nb::module_& m);

}  // namespace smartmesh
