// What Python sees of shapes of bodies, and the ground near them.
#include <nanobind/stl/vector.h>

#include "python/body_tables.h"
#include "shape/gap.h"

namespace smartmesh {
namespace {

// Returns how far points (n, 3) are outside the hull of the points `kept` (k, 3) [m], zero for those inside.
void distances_outside(const Doubles2& kept, const Doubles2& points, const Array<double, 1>& found) {
  check_table(kept, kept.shape(0), 3, "kept"), check_table(points, points.shape(0), 3, "points");
  check_list(found, points.shape(0), "found");
  require(kept.shape(0) > 0, "a hull has at least one point");
  Shape shape;
  shape.kind = ShapeKind::Hull, shape.rows = static_cast<std::int64_t>(kept.shape(0));
  const Solid hull(shape, {}, rows_of<Vec3>(kept));
  for (std::size_t k = 0; k < points.shape(0); ++k) found.data()[k] = distance_of_point(rows_of<Vec3>(points)[k], hull);
}

}  // namespace

void add_bodies(nb::module_& m) {
  nb::class_<Shapes>(m, "Shapes")
      .def(nb::init<Bytes2, Bytes2, Doubles2>(), "shapes"_a.noconvert(), "parts"_a.noconvert(),
           "vertices"_a.noconvert());
  m.def("distances_outside", &distances_outside, "kept"_a.noconvert(), "points"_a.noconvert(), "found"_a.noconvert());
}

}  // namespace smartmesh
