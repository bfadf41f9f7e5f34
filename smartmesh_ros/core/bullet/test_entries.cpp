// Entries of the core for tests alone: contacts of one shape with one height map or mesh, without PyBullet.
#include "bindings.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include <nanobind/ndarray.h>

#include "alignment.h"
#include "convert.h"
#include "contact_search.h"

namespace nb = nanobind;
using namespace nb::literals;

namespace smartmesh {
namespace {

using Heights = nb::ndarray<const float, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Triangles = nb::ndarray<const std::int64_t, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

// Columns of a table of contacts: point, normal, distance, and the names of both features.
constexpr std::size_t COLUMNS = 9;
// Largest height map of a test, and largest number of a hull's points.
constexpr std::size_t MOST_SAMPLES = 1u << 12, MOST_POINTS = 1u << 16;

double checked(double value, const char* name) {
  if (!(value >= 0.0 && value < 1e9)) throw std::invalid_argument(std::string(name) + " must be at least zero and finite");
  return value;
}

Vec3 row_of(const Points& points, std::size_t k) {
  const double* p = points.data() + 3 * k;
  if (!std::isfinite(p[0] + p[1] + p[2])) throw std::invalid_argument("points and poses must be finite");
  return {p[0], p[1], p[2]};
}

Convex hull_of_rows(const Points& points, double margin) {
  const std::size_t count = points.shape(0);
  check_alignment(points.data(), sizeof(double));
  if (count == 0 || count > MOST_POINTS) throw std::invalid_argument("a hull has 1 to 65536 points");
  std::vector<btVector3> found;
  for (std::size_t k = 0; k < count; ++k) found.push_back(to_bullet(row_of(points, k)));
  return hull_of(found, checked(margin, "the margin"));
}

// How a shape meets the ground. `pose` (4, 3): the rows of the rotation, then the position. `motion` (2, 3): linear and
// angular velocity relative to the ground.
Table contacts_with(Surface& surface, const Convex& shape, const Points& pose, const Points& motion, double duration,
                    double margin) {
  check_alignment(pose.data(), sizeof(double)), check_alignment(motion.data(), sizeof(double));
  if (pose.shape(0) != 4) throw std::invalid_argument("a pose has the shape (4, 3): rotation and position");
  if (motion.shape(0) != 2) throw std::invalid_argument("a motion has the shape (2, 3): linear and angular velocity");
  Pose at;
  for (std::size_t k = 0; k < 3; ++k) at.turn.row[k] = row_of(pose, k);
  at.at = row_of(pose, 3);
  const Approach approach{row_of(motion, 0), row_of(motion, 1), at.at, checked(duration, "the duration"),
                          checked(margin, "the margin"), Vec3{}};
  std::vector<Contact> contacts;
  ContactSearch().run(shape, at, surface, 0.0, approach, contacts);
  auto* found = new double[std::max<std::size_t>(1, contacts.size() * COLUMNS)];
  nb::capsule owner(found, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  double* next = found;
  for (const Contact& c : contacts)
    for (double value : {c.point.x, c.point.y, c.point.z, c.normal.x, c.normal.y, c.normal.z, c.distance,
                         static_cast<double>(c.body_feature), static_cast<double>(c.ground_feature)})
      *next++ = value;
  return Table(found, {contacts.size(), COLUMNS}, owner);
}

Table mesh_contacts_of(const Convex& shape, const Points& pose, const Points& vertices, const Triangles& triangles,
                       const Points& motion, double duration, double margin) {
  const std::size_t count = vertices.shape(0);
  check_alignment(vertices.data(), sizeof(double)), check_alignment(triangles.data(), sizeof(std::int64_t));
  if (count > MOST_SAMPLES || triangles.shape(0) < 1 || triangles.shape(0) > MOST_SAMPLES)
    throw std::invalid_argument("a test's mesh has 1 to 4096 triangles");
  std::vector<double> now(3 * count);
  for (std::size_t v = 0; v < count; ++v) {
    const Vec3 p = row_of(vertices, v);
    now[v] = p.x, now[count + v] = p.y, now[2 * count + v] = p.z;
  }
  for (std::size_t k = 0; k < triangles.size(); ++k)
    if (triangles.data()[k] < 0 || triangles.data()[k] >= static_cast<std::int64_t>(count))
      throw std::invalid_argument("a triangle uses a vertex that is not there");
  const Clock clock{};
  MeshSurface mesh;
  mesh.now = now.data(), mesh.clock = &clock, mesh.triangles = triangles.data();
  mesh.vertices = static_cast<int>(count), mesh.triangle_count = static_cast<int>(triangles.shape(0));
  mesh.update();
  Surface surface;
  surface.set_tiles({}, {&mesh});
  return contacts_with(surface, shape, pose, motion, duration, margin);
}

Table contacts_of(const Convex& shape, const Points& pose, const Heights& heights, double resolution, double yaw,
                  const Points& motion, double duration, double margin) {
  const std::size_t rows = heights.shape(0), columns = heights.shape(1);
  if (rows < 2 || columns < 2 || rows > MOST_SAMPLES || columns > MOST_SAMPLES)
    throw std::invalid_argument("a test's height map has 2 to 4096 rows and columns");
  check_alignment(heights.data(), sizeof(float));
  if (!(resolution > 1e-9)) throw std::invalid_argument("the resolution must be above zero");
  const std::size_t block_columns = (columns + 63) >> BLOCK_SHIFT;
  const std::vector<Clock> clocks(((rows + 63) >> BLOCK_SHIFT) * block_columns, Clock{});
  HeightGrid grid;
  grid.heights = heights.data(), grid.clocks = clocks.data(), grid.block_columns = static_cast<int>(block_columns);
  grid.rows = static_cast<int>(rows), grid.columns = static_cast<int>(columns);
  if (!std::isfinite(yaw)) throw std::invalid_argument("the yaw must be finite");
  grid.resolution = checked(resolution, "the resolution"), grid.yaw = yaw;
  Surface surface;
  surface.set_tiles({&grid}, {});
  return contacts_with(surface, shape, pose, motion, duration, margin);
}

}  // namespace

void add_test_entries(nb::module_& m) {
  nb::class_<Convex>(m, "Shape")
      .def_static("ball", [](double radius) { return ball(checked(radius, "the radius")); }, "radius"_a)
      .def_static(
          "capsule",
          [](double radius, double half) { return capsule(checked(radius, "the radius"), checked(half, "half")); },
          "radius"_a, "half"_a)
      .def_static(
          "cylinder",
          [](double radius, double half) { return cylinder(checked(radius, "the radius"), checked(half, "half")); },
          "radius"_a, "half"_a)
      .def_static(
          "box",
          [](double x, double y, double z) { return box({checked(x, "x"), checked(y, "y"), checked(z, "z")}); }, "x"_a,
          "y"_a, "z"_a)
      .def_static("hull", &hull_of_rows, "points"_a.noconvert(), "margin"_a);
  m.def("find_contacts", &contacts_of, "shape"_a, "pose"_a.noconvert(), "heights"_a.noconvert(), "resolution"_a, "yaw"_a,
        "motion"_a.noconvert(), "duration"_a, "margin"_a);
  m.def("find_mesh_contacts", &mesh_contacts_of, "shape"_a, "pose"_a.noconvert(), "vertices"_a.noconvert(),
        "triangles"_a.noconvert(), "motion"_a.noconvert(), "duration"_a, "margin"_a);
}

}  // namespace smartmesh
