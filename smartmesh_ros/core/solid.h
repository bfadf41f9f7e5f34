// Shapes of bodies at their poses.
#pragma once

#include <vector>

#include "shape.h"

namespace smartmesh {

// Position, orientation (x, y, z, w), velocity and angular velocity of a body: its row in a table.
constexpr int BODY_COLUMNS = 13;

// Shapes of bodies by slot, parts of compounds, and vertices of hulls, (x, y, z) each [m]. The arrays belong to Python.
struct ShapeTable {
  const Shape *shapes = nullptr, *parts = nullptr;
  const Vec3* vertices = nullptr;
  std::int64_t shape_count = 0, part_count = 0, vertex_count = 0;

  // Returns true if the table has all parts and vertices that a shape names.
  bool has_all_of(const Shape& shape) const;
};

// A shape in the world, or in another frame. `axes`: its rows are the shape's axes. `vertices`: of a hull, in its own frame.
struct Solid {
  const Shape* shape = nullptr;
  Vec3 centre;
  Mat3 axes;
  const Vec3* vertices = nullptr;

  Solid() = default;
  // Places a shape in a frame with the origin `at`, turned by `turn`.
  Solid(const Shape& placed, const Vec3& at, const Turn& turn, const Vec3* of_hull = nullptr);

  Vec3 to_own(const Vec3& p) const { return axes * (p - centre); }
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
void place_shape(const ShapeTable& table, const Shape& shape, const double* body, BodySolid& placed);

}  // namespace smartmesh
