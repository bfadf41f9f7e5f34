// What Python sees of shapes of bodies.
#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/vector.h>

#include "bullet/shape_parts.h"
#include "bullet/world.h"
#include "python/bindings.h"
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

std::vector<Vec3> points_of(const Rows<const Vec3>& points) {
  if (points.size() == 0) throw std::invalid_argument("a hull has at least one point");
  return {points.begin(), points.end()};
}

std::vector<BodyShape> parts_of(const BodyShape& shape) {
  std::vector<BodyShape> found;
  for (const ShapePart& part : shape.parts) found.push_back(BodyShape({part}));
  return found;
}

auto vertices_of(const BodyShape& shape) {
  return array_of(shape.parts.size() == 1 ? shape.parts[0].vertices : std::vector<Vec3>());
}

// The numbers of a part, in the order of ShapePart, of which a copy is made.
using PartNumbers = std::tuple<std::int64_t, Triple, double, Triple, Quadruple, double, Triple, std::vector<Triple>>;

std::vector<PartNumbers> state_of(const BodyShape& body) {
  std::vector<PartNumbers> found;
  for (const auto& [shape, inside, vertices] : body.parts) {
    const auto& [kind, half, rounding, offset, q, radius] = shape;
    std::vector<Triple> points;
    for (const Vec3& vertex : vertices) points.push_back(numbers_of(vertex));
    found.emplace_back(static_cast<std::int64_t>(kind), numbers_of(half), rounding, numbers_of(offset),
                       Quadruple{q.x, q.y, q.z, q.w}, radius, numbers_of(inside), points);
  }
  return found;
}

void set_state(BodyShape& body, const std::vector<PartNumbers>& state) {
  std::vector<ShapePart> parts;
  for (const auto& [kind, half, rounding, offset, q, radius, inside, points] : state) {
    const BodyPose pose = pose_at(offset, q);
    const Shape shape{static_cast<ShapeKind>(kind), vector_of(half), rounding, pose.at, pose.orientation, radius};
    std::vector<Vec3> vertices;
    for (const Triple& point : points) vertices.push_back(vector_of(point));
    parts.push_back({shape, vector_of(inside), vertices});
  }
  new (&body) BodyShape(std::move(parts));
}

// Returns how far points (n, 3) are outside the hull of the points `kept` (k, 3) [m], zero for those inside.
auto distances_outside(const Rows<const Vec3>& kept, const Rows<const Vec3>& points) {
  const Convex of = hull(points_of(kept), 0.0);
  std::vector<double> found;
  for (const Vec3& point : points_of(points)) found.push_back(distance_outside(of.core, point));
  return array_of(std::move(found));
}

using Poses = Rows<const BodyPose>;

const BodyPose* poses_of(const LowerSurface& surface, const Poses& poses) {
  check_counts(surface.size(), poses);
  return poses.data();
}

// Returns the lowest and the highest corner (2, 3) of the box around the parts [m].
auto bounds_at(const LowerSurface& surface, const Poses& poses) {
  const Bounds bounds = surface.bounds(poses_of(surface, poses));
  return array_of(std::vector<Vec3>{bounds.low, bounds.high});
}

// Returns the lowest points (n * parts, 3) [m] along unit vectors (n, 3).
auto lowest_points(const LowerSurface& surface, const Poses& poses, const Rows<const Vec3>& up) {
  const BodyPose* placed = poses_of(surface, poses);
  std::vector<Vec3> points;
  for (const Vec3& way : up) surface.add_lowest(placed, way, points);
  return array_of(std::move(points));
}

// Returns the heights (n,) of the lower surface at points (n, 2) [m], NaN beside it.
auto lower_heights(const LowerSurface& surface, const Poses& poses, const Rows<const Place>& points) {
  return array_of(surface.find(poses_of(surface, poses), points.numbers(), points.size()));
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
          [](const Rows<const Vec3>& points, double rounding) {
            return BodyShape({hull_part(points_of(points), rounding)});
          },
          "points"_a, "rounding"_a = 0.0)
      .def("__getstate__", &state_of)
      .def("__setstate__", &set_state)
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
      .def("bounds", &bounds_at, "poses"_a)
      .def("lowest", &lowest_points, "poses"_a, "up"_a)
      .def("heights", &lower_heights, "poses"_a, "points"_a);
  m.def("shapes_of", &shapes_of, "number"_a, "body"_a);
  m.def("distances_outside", &distances_outside, "kept"_a, "points"_a);
}

}  // namespace smartmesh
