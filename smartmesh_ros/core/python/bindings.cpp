// What Python sees of the core. Arguments are checked here or by nanobind's types; nothing else in the core knows
// Python.
#include "python/bindings.h"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

namespace smartmesh {
namespace {

// Arrays of a map's memory, which is kept by each of them. Python may write to them between steps.
template <class T, std::size_t N>
using View = nb::ndarray<nb::numpy, T, nb::ndim<N>, nb::c_contig>;

template <class T, class... Sizes>
View<T, sizeof...(Sizes)> view_of(const nb::object& self, T* data, Sizes... sizes) {
  return View<T, sizeof...(Sizes)>(data, {static_cast<std::size_t>(sizes)...}, self);
}

auto samples_of(const nb::object& self, float* HeightGrid::*array) {
  const HeightGrid& map = nb::cast<Grid&>(self).grid;
  return view_of(self, map.*array, map.rows, map.columns);
}

template <auto array>
auto vertices_of(nb::object self) {
  MeshSurface& mesh = nb::cast<Mesh&>(self).surface;
  return view_of(self, (mesh.*array).data(), 3, mesh.vertices);
}

auto mesh_velocities_of(nb::object self) {
  const MeshSurface& mesh = nb::cast<Mesh&>(self).surface;
  return view_of(self, mesh.velocities.data(), KEPT, 3, mesh.vertices);
}

auto mesh_clock_of(nb::object self) {
  return view_of(self, reinterpret_cast<std::uint8_t*>(&nb::cast<Mesh&>(self).surface.clock), 1, sizeof(Clock));
}

auto velocities_of(nb::object self) {
  Grid& map = nb::cast<Grid&>(self);
  return view_of(self, map.velocities.data(), KEPT, map.grid.rows, map.grid.columns);
}

// Returns the clocks (rows, columns, bytes) of the blocks.
auto clocks_of(nb::object self) {
  Grid& map = nb::cast<Grid&>(self);
  const std::size_t columns = static_cast<std::size_t>(map.grid.block_columns);
  return view_of(self, reinterpret_cast<std::uint8_t*>(map.clocks.data()), map.clocks.size() / columns, columns,
                 sizeof(Clock));
}

// Returns the fused heights and their variances (rows, columns); None = heights are not fused.
nb::object fused_of(nb::object self) {
  Grid& map = nb::cast<Grid&>(self);
  if (map.fused.empty()) return nb::none();
  const auto view = [&](std::vector<float>& array) {
    return view_of(self, array.data(), map.grid.rows, map.grid.columns);
  };
  return nb::cast(std::make_tuple(view(map.fused), view(map.variances)));
}

// A field of a record that Python shares: its name, its NumPy type, numbers of double precision or whole ones, and its
// place [bytes].
using FieldLayout = std::tuple<std::string, std::string, std::size_t>;

template <class Field>
FieldLayout field(const char* name, Field Clock::*member) {
  static_assert(sizeof(Field) % 8 == 0, "numbers of eight bytes");
  static const Clock clock{};
  const std::string numbers = std::is_array_v<Field> ? "(" + std::to_string(sizeof(Field) / 8) + ",)" : "";
  return {name, numbers + (std::is_integral_v<Field> ? "i8" : "f8"),
          static_cast<std::size_t>(reinterpret_cast<const char*>(&(clock.*member)) -
                                   reinterpret_cast<const char*>(&clock))};
}

std::vector<FieldLayout> clock_layout() {
  return {field("time", &Clock::time),         field("opened", &Clock::opened),  field("lifetime", &Clock::lifetime),
          field("delay", &Clock::delay),       field("middle", &Clock::middle),  field("middle_1", &Clock::middle_1),
          field("middle_2", &Clock::middle_2), field("since", &Clock::since),    field("until", &Clock::until),
          field("known", &Clock::known),       field("newest", &Clock::newest),  field("intervals", &Clock::intervals),
          field("count", &Clock::count),       field("updates", &Clock::updates)};
}

}  // namespace
}  // namespace smartmesh

NB_MODULE(_core, m) {
  using namespace smartmesh;
  m.def("next_revision", &next_revision);
  nb::set_leak_warnings(false);  // a ground may live until the process ends
  m.attr("CLOCK") = clock_layout();
  nb::class_<Grid>(m, "Grid")
      .def(nb::init<int, int>(), "rows"_a, "columns"_a)
      .def_prop_ro("heights", [](nb::object self) { return samples_of(self, &HeightGrid::heights); })
      .def_prop_ro("offsets", [](nb::object self) { return samples_of(self, &HeightGrid::offsets); })
      .def_prop_ro("rates", [](nb::object self) { return samples_of(self, &HeightGrid::rates); })
      .def_prop_ro("velocities", &velocities_of)
      .def_prop_ro("clocks", &clocks_of)
      .def_prop_ro("fused", &fused_of)
      .def("begin_fusion", &Grid::begin_fusion)
      .def("note_change", &Grid::note_change)
      .def_prop_ro("revision", [](const Grid& g) { return g.grid.revision; })
      .def("place", &Grid::place, "x"_a, "y"_a, "z"_a, "yaw"_a, "resolution"_a)
      .def("move", &Grid::move, "time"_a, "interval"_a, "x"_a, "y"_a, "spin"_a)
      .def("show", &Grid::show, "instant"_a)
      .def_prop_ro("shown", [](const Grid& g) { return g.grid.shown; })
      .def_prop_rw(
          "settled", [](const Grid& g) { return g.grid.settled; },
          [](Grid& g, double instant) {
            const StepLock lock;
            g.grid.settled = instant;
          })
      .def("set_layer", &Grid::set_layer, "layer"_a, "samples"_a, "uniform"_a)
      .def("set_motion", &Grid::set_motion, "mode"_a, "max_velocity"_a, "settle"_a, "noise"_a, "smoothing"_a)
      .def(
          "moves", [](const Grid& g, double time) { return g.grid.moves(time); }, "time"_a)
      .def("sample", [](const Grid& g, int row, int column, double time, double ahead) {
        const Sample s = GridReader(g.grid, time, ahead).read(row, column);
        return std::make_tuple(s.height, s.rise);
      });
  nb::class_<Mesh>(m, "Mesh")
      .def(nb::init<Doubles2, Triangles>(), "vertices"_a, "triangles"_a)
      .def_prop_ro("vertices", &vertices_of<&MeshSurface::now>)
      .def_prop_ro("offsets", &vertices_of<&MeshSurface::offsets>)
      .def_prop_ro("rates", &vertices_of<&MeshSurface::rates>)
      .def_prop_ro("velocities", &mesh_velocities_of)
      .def_prop_ro("clocks", &mesh_clock_of)
      .def("set_motion", &Mesh::set_motion, "mode"_a, "max_velocity"_a, "smoothing"_a)
      .def(
          "moves", [](const Mesh& m, double time) { return m.surface.moves(time); }, "time"_a)
      .def_prop_rw(
          "shown", [](const Mesh& m) { return m.surface.shown; }, [](Mesh& m, double t) { m.surface.shown = t; });
  add_ground(m);
  add_contacts(m);
  add_queries(m);
  add_updates(m);
  add_soil(m);
  add_bodies(m);
  add_patches(m);
  add_rows(m);
  add_decks(m);
}
