// What Python sees of the core. Arguments are checked here or by nanobind's types; nothing else in the core knows Python.
#include "bindings.h"

NB_MODULE(_core, m) {
  using namespace smartmesh;
  nb::set_leak_warnings(false);  // a ground may live until the process ends
  nb::class_<Grid>(m, "Grid")
      .def(nb::init<Array<float, 2>, Array<float, 3>, Array<float, 2>, Array<float, 2>, Array<std::uint8_t, 3>>(),
           "heights"_a.noconvert(), "velocities"_a.noconvert(), "offsets"_a.noconvert(), "rates"_a.noconvert(),
           "clocks"_a.noconvert())
      .def("place", &Grid::place, "x"_a, "y"_a, "z"_a, "yaw"_a, "resolution"_a)
      .def("move", &Grid::move, "time"_a, "interval"_a, "x"_a, "y"_a, "spin"_a)
      .def("show", &Grid::show, "instant"_a)
      .def_prop_ro("shown", [](const Grid& g) { return g.grid.shown; })
      .def("set_friction", &Grid::set_friction, "samples"_a.noconvert().none(), "uniform"_a)
      .def("set_variances", &Grid::set_variances, "samples"_a.noconvert().none())
      .def("set_motion", &Grid::set_motion, "mode"_a, "max_velocity"_a, "settle"_a, "noise"_a, "smoothing"_a)
      .def("moves", [](const Grid& g, double time) { return g.grid.moves(time); }, "time"_a)
      .def("lifetime", [](const Grid& g) { return g.grid.lifetime(); })
      .def("sample", [](const Grid& g, int row, int column, double time, double ahead) {
        const Sample s = GridReader(g.grid, time, ahead).read(row, column);
        return std::make_tuple(s.height, s.rise);
      });
  nb::class_<Mesh>(m, "Mesh")
      .def(nb::init<States, Array<double, 3>, States, States, Array<std::uint8_t, 2>, Whole2>(), "vertices"_a.noconvert(),
           "velocities"_a.noconvert(), "offsets"_a.noconvert(), "rates"_a.noconvert(), "clock"_a.noconvert(), "triangles"_a.noconvert())
      .def("set_motion", &Mesh::set_motion, "mode"_a, "max_velocity"_a, "smoothing"_a)
      .def("moves", [](const Mesh& m, double time) { return m.surface.moves(time); }, "time"_a)
      .def("update", &Mesh::update);
  add_ground(m);
  add_contacts(m);
  add_queries(m);
  add_updates(m);
  add_soil(m);
  add_bodies(m);
  add_rows(m);
  add_scans(m);
  add_decks(m);
}
