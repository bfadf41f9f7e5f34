// Shapes of bodies as Python keeps them, and the convex solids that they are at the poses of bodies.
//
// A convex solid is a core (point, segment, box, cylinder, or hull of vertices), grown by a rounding radius.
#pragma once

#include <cstdint>
#include <vector>

#include "rotation.h"

namespace smartmesh {

enum class ShapeKind : std::int64_t { Ball = 0, Capsule = 1, Box = 2, Cylinder = 3, Hull = 4, Compound = 5 };

// A shape, with the layout of the NumPy type SHAPE in patches/shapes.py, which explains the fields.
struct ShapeRecord {
  ShapeKind kind;
  double half[3], rounding, offset[3], turn[4], reach, radius;
  std::int64_t first, rows;
};
static_assert(sizeof(ShapeRecord) == 128, "the layout of SHAPE in patches/shapes.py");

// Position, orientation (x, y, z, w), velocity and angular velocity of a body: its row in a table.
constexpr int BODY_COLUMNS = 13;

// Shapes of bodies by slot, parts of compounds, and vertices of hulls, (x, y, z) each [m]. The arrays belong to Python.
struct ShapeTable {
  const ShapeRecord *shapes = nullptr, *parts = nullptr;
  const double* vertices = nullptr;
  std::int64_t shape_count = 0, part_count = 0, vertex_count = 0;

  // Returns true if the table has all parts and vertices that a shape names.
  bool has_all_of(const ShapeRecord& shape) const;
};

// A convex solid, or the frame of a compound, in the world. `axes`: its rows are the solid's axes. `half` extents of the
// core along them, and `rounding` radius [m]; `reach` [m]: bounding radius about the centre. `vertices`: of a hull, in its
// own frame.
struct Solid {
  ShapeKind kind = ShapeKind::Ball;
  Vec3 centre;
  Mat3 axes;
  Vec3 half;
  double rounding = 0.0, reach = 0.0;
  const double* vertices = nullptr;
  std::int64_t rows = 0;

  Vec3 to_own(const Vec3& p) const { return axes * (p - centre); }
  Vec3 vertex(std::int64_t k) const { return {vertices[3 * k], vertices[3 * k + 1], vertices[3 * k + 2]}; }

  // Returns the farthest point of the core along a direction, both in the solid's own frame.
  Vec3 core_support(const Vec3& direction) const;
  // Returns the distance from the centre to the farthest point along a unit direction of the world.
  double reach_along(const Vec3& direction) const;
};

// A body's shape in the world: the frame of the `whole`, and the convex solids that it consists of.
struct BodySolid {
  Solid whole;
  std::vector<Solid> parts;

  double lowest() const;  // height of the lowest point [m]
};

// Places a shape, which the table has all of, on a body (13,).
void place_shape(const ShapeTable& table, const ShapeRecord& shape, const double* body, BodySolid& placed);

}  // namespace smartmesh
