// Soil as Python sees it, and what tests see of the undersides that press it.
#include "python/soil_binding.h"
#include "shape/body_shape.h"
#include "soil/soil_shape.h"

namespace smartmesh {
namespace {

// Returns for points (n, 2) [m] the underside of a shape [m], its normal there, and the share of a cell that it covers,
// (n, 5); and its half extents along columns and rows [m]. `of`: in axes of the grid. For tests.
auto shape_above_grid(const BodyShape& of, Rows<const Place> points, double spacing) {
  if (!is_primitive(of.outline.kind))
    throw std::invalid_argument("soil is pressed by boxes, balls, cylinders and capsules alone");
  const Underside shape = underside(Solid(of.outline, {}), spacing);
  UndersideRow row;
  std::vector<std::array<double, 5>> found;
  for (const auto& [x, y] : points) {
    row.x.assign(1, x), row.y = y;
    look_up(shape, row), cover(shape, row);
    const Vec3 normal = normal_at(shape, shape.grown, {x, y, row.low[0]});
    found.push_back({row.low[0], normal.x, normal.y, normal.z, row.share[0]});
  }
  return std::make_tuple(array_of(std::move(found)), half_extent(shape, 0), half_extent(shape, 1));
}

}  // namespace

void add_soil(nb::module_& m) {
  nb::class_<Soil>(m, "Soil")
      .def(nb::init<nb::object, Bytes2, Rows<const SoilType>, double>(), "grid"_a, "kinds"_a, "soils"_a, "spacing"_a)
      .def("set_kinds", &Soil::set_kinds, "kinds"_a)
      .def("take_pressed", &Soil::take_pressed)
      .def("memory", &Soil::memory)
      .def("recall", &Soil::recall, "places"_a, "samples"_a, "nodes"_a, "heights"_a, "pressed"_a, "step"_a)
      .def("sinkage", &Soil::sinkage, "found"_a)
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
  m.def("shape_above_grid", &shape_above_grid, "shape"_a, "points"_a, "spacing"_a);
}

}  // namespace smartmesh
