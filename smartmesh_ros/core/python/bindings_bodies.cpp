// What Python sees of shapes of bodies.
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/vector.h>

#include "bullet/shape_parts.h"
#include "bullet/world.h"
#include "python/tables.h"
#include "shape/body_shape.h"
#include "shape/lower_surface.h"
#include "step/step_lock.h"

namespace smartmesh {
namespace {

using Triple = std::array<double, 3>;
using Quadruple = std::array<double, 4>;
constexpr Triple CENTRE{0.0, 0.0, 0.0};
constexpr Quadruple UNROTATED{0.0, 0.0, 0.0, 1.0};

Vec3 vector_of(const Triple& v) { return {v[0], v[1], v[2]}; }
Triple numbers_of(const Vec3& v) { return {v.x, v.y, v.z}; }
BodyPose pose_at(const Triple& offset, const Quadruple& q) { return {vector_of(offset), {q[0], q[1], q[2], q[3]}}; }

BodyShape primitive(ShapeKind kind, const Vec3& half, double rounding, const Triple& offset, const Quadruple& q) {
  return BodyShape({primitive_part(kind, half, rounding, pose_at(offset, q))});
}

// Returns the shapes of a PyBullet body by link; see link_shapes.
std::map<int, BodyShape> shapes_of(int number, int body) {
  const StepLock lock;
  BulletWorld* world = world_of(number);
  if (world == nullptr) throw std::runtime_error("the PyBullet client is disconnected");
  return link_shapes(world->now.world, body);
}

std::vector<Vec3> points_of(const Doubles2& points) {
  const Vec3* first = records_of<Vec3>(points, "points");
  if (points.shape(0) == 0) throw std::invalid_argument("a hull has at least one point");
  return {first, first + points.shape(0)};
}

BodyShape compound(const std::vector<BodyShape>& shapes) {
  std::vector<ShapePart> parts;
  for (const BodyShape& shape : shapes) parts.insert(parts.end(), shape.parts.begin(), shape.parts.end());
  if (parts.empty()) throw std::invalid_argument("a compound has at least one part");
  return BodyShape(parts);
}

std::vector<BodyShape> parts_of(const BodyShape& shape) {
  std::vector<BodyShape> found;
  for (const ShapePart& part : shape.parts) found.push_back(BodyShape({part}));
  return found;
}

NewTable vertices_of(const BodyShape& shape) {
  const std::vector<Vec3> none, &vertices = shape.parts.size() == 1 ? shape.parts[0].vertices : none;
  NewTable found = new_array<double, 2>({vertices.size(), 3});
  std::copy(vertices.begin(), vertices.end(), reinterpret_cast<Vec3*>(found.data()));
  return found;
}

// Returns how far points (n, 3) are outside the hull of the points `kept` (k, 3) [m], zero for those inside.
auto distances_outside(const Doubles2& kept, const Doubles2& points) {
  const Convex of = hull(points_of(kept), 0.0);
  std::vector<double> found;
  for (const Vec3& point : points_of(points)) found.push_back(distance_outside(of.core, point));
  return array_of<double, 1>(found, {found.size()});
}

const BodyPose* poses_of(const LowerSurface& surface, const Doubles2& poses) {
  if (poses.shape(0) != surface.size()) throw std::invalid_argument("each shape needs a pose");
  return records_of<BodyPose>(poses, "poses");
}

// Returns the lowest and the highest corner (2, 3) of the box around the parts [m].
NewTable bounds_at(const LowerSurface& surface, const Doubles2& poses) {
  const Bounds bounds = surface.bounds(poses_of(surface, poses));
  return array_of<double, 2>({bounds.low.x, bounds.low.y, bounds.low.z, bounds.high.x, bounds.high.y, bounds.high.z},
                             {2, 3});
}

// Returns the lowest points (n * parts, 3) [m] along unit vectors (n, 3).
NewTable lowest_points(const LowerSurface& surface, const Doubles2& poses, const Doubles2& up) {
  const BodyPose* placed = poses_of(surface, poses);
  const Vec3* first = records_of<Vec3>(up, "up");
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < up.shape(0); ++k) surface.add_lowest(placed, first[k], points);
  return table_of(points);
}

// Returns the heights (n,) of the lower surface at points (n, 2) [m], NaN beside it.
auto lower_heights(const LowerSurface& surface, const Doubles2& poses, const Doubles2& points) {
  const BodyPose* placed = poses_of(surface, poses);
  const std::size_t count = points.shape(0);
  check_table(points, count, 2, "points");
  auto found = new_array<double, 1>({count});
  surface.find(placed, points.data(), count, found.data());
  return found;
}

}  // namespace

void add_bodies(nb::module_& m) {
  nb::class_<BodyShape>(m, "BodyShape")
      .def_static(
          "ball",
          [](double radius, const Triple& offset) { return primitive(ShapeKind::Ball, {}, radius, offset, UNROTATED); },
          "radius"_a, "offset"_a = CENTRE)
      .def_static(
          "capsule",
          [](double radius, double height, const Triple& offset, const Quadruple& orientation) {
            return primitive(ShapeKind::Capsule, {0.0, 0.0, 0.5 * height}, radius, offset, orientation);
          },
          "radius"_a, "height"_a, "offset"_a = CENTRE, "orientation"_a = UNROTATED)
      .def_static(
          "cylinder",
          [](double radius, double height, const Triple& offset, const Quadruple& orientation) {
            return primitive(ShapeKind::Cylinder, {radius, radius, 0.5 * height}, 0.0, offset, orientation);
          },
          "radius"_a, "height"_a, "offset"_a = CENTRE, "orientation"_a = UNROTATED)
      .def_static(
          "box",
          [](const Triple& edges, const Triple& offset, const Quadruple& orientation) {
            return primitive(ShapeKind::Box, vector_of(edges) * 0.5, 0.0, offset, orientation);
          },
          "edges"_a, "offset"_a = CENTRE, "orientation"_a = UNROTATED)
      .def_static(
          "hull",
          [](const Doubles2& points, double rounding) { return BodyShape({hull_part(points_of(points), rounding)}); },
          "points"_a.noconvert(), "rounding"_a = 0.0)
      .def_static("compound", &compound, "shapes"_a)
      .def_prop_ro("kind", [](const BodyShape& s) { return static_cast<int>(s.outline.kind); })
      .def_prop_ro("half", [](const BodyShape& s) { return numbers_of(s.outline.half); })
      .def_prop_ro("rounding", [](const BodyShape& s) { return s.outline.rounding; })
      .def_prop_ro("offset", [](const BodyShape& s) { return numbers_of(s.outline.offset); })
      .def_prop_ro("orientation",
                   [](const BodyShape& s) {
                     const Quaternion& q = s.outline.orientation;
                     return Quadruple{q.x, q.y, q.z, q.w};
                   })
      .def_ro("radius", &BodyShape::radius)
      .def_prop_ro("parts", &parts_of)
      .def_prop_ro("vertices", &vertices_of, nb::rv_policy::automatic);  // a new array is no part of the shape
  nb::class_<LowerSurface>(m, "LowerSurface")
      .def(nb::init<const std::vector<BodyShape>&>(), "shapes"_a)
      .def("bounds", &bounds_at, "poses"_a.noconvert())
      .def("lowest", &lowest_points, "poses"_a.noconvert(), "up"_a.noconvert())
      .def("heights", &lower_heights, "poses"_a.noconvert(), "points"_a.noconvert());
  m.def("shapes_of", &shapes_of, "number"_a, "body"_a);
  m.def("distances_outside", &distances_outside, "kept"_a.noconvert(), "points"_a.noconvert());
}

}  // namespace smartmesh
