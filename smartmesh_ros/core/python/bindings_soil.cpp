// Soil as Python sees it, and what tests see of the undersides that press it.
#include "python/bindings.h"
#include "python/soil_binding.h"
#include "python/tables.h"
#include "shape/body_shape.h"
#include "soil/soil_shape.h"

namespace smartmesh {
namespace {

// Returns for points (n, 2) [m] the underside of a shape [m], its normal there, and the share of a cell that it covers,
// (n, 5); and its half extents along columns and rows [m]. `of`: in axes of the grid. For tests.
std::tuple<NewTable, double, double> shape_above_grid(const BodyShape& of, Doubles2 points, double spacing) {
  check_table(points, points.shape(0), 2, "points");
  if (!is_primitive(of.outline.kind))
    throw std::invalid_argument("soil is pressed by boxes, balls, cylinders and capsules alone");
  const Underside shape = underside(Solid(of.outline, {}), spacing);
  UndersideRow row;
  std::vector<double> found;
  for (std::size_t k = 0; k < points.shape(0); ++k) {
    row.x.assign(1, points.data()[2 * k]), row.y = points.data()[2 * k + 1];
    look_up(shape, row), cover(shape, row);
    const Vec3 normal = normal_at(shape, {row.x[0], row.y, row.low[0]});
    found.insert(found.end(), {row.low[0], normal.x, normal.y, normal.z, row.share[0]});
  }
  return {array_of<double, 2>(found, {points.shape(0), 5}), half_extent(shape, 0), half_extent(shape, 1)};
}

}  // namespace

void add_soil(nb::module_& m) {
  nb::class_<Soil>(m, "Soil")
      .def(nb::init<nb::object, Bytes2, Doubles2, double>(), "grid"_a, "kinds"_a.noconvert(), "soils"_a.noconvert(),
           "spacing"_a)
      .def("set_kinds", &Soil::set_kinds, "kinds"_a.noconvert())
      .def("take_pressed", &Soil::take_pressed)
      .def("memory", &Soil::memory)
      .def("recall", &Soil::recall, "places"_a.noconvert(), "samples"_a.noconvert(), "nodes"_a.noconvert(),
           "heights"_a.noconvert(), "pressed"_a.noconvert(), "step"_a)
      .def("sinkage", &Soil::sinkage, "found"_a.noconvert())
      .def_prop_rw(
          "sinks_by_slip", [](const Soil& s) { return s.soil.lattice.sinks_by_slip; },
          [](Soil& s, bool on) {
            const StepLock lock;
            s.soil.lattice.sinks_by_slip = on;
          })
      .def("reset", [](Soil& s) {
        const StepLock lock;
        s.soil.lattice.reset();
      });
  m.def("shape_above_grid", &shape_above_grid, "shape"_a, "points"_a.noconvert(), "spacing"_a);
}

}  // namespace smartmesh
