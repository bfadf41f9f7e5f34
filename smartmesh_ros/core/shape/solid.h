// Shapes of bodies at their poses.
#pragma once

#include <vector>

#include "shape/shape.h"

namespace smartmesh {

struct BodyPose {
  Vec3 at;  // [m]
  Quaternion orientation;
};

// State of a body: its row in a table.
struct BodyState {
  BodyPose pose;
  Vec3 linear, angular;  // [m/s], [rad/s]
};
constexpr int BODY_COLUMNS = 13;
static_assert(sizeof(BodyState) == BODY_COLUMNS * sizeof(double), "the columns of a table of bodies");

// Shapes of bodies by slot, parts of compounds, and vertices of hulls, (x, y, z) each [m]. The arrays belong to Python.
struct ShapeTable {
  const Shape *shapes = nullptr, *parts = nullptr;
  const Vec3* vertices = nullptr;
  std::int64_t shape_count = 0, part_count = 0, vertex_count = 0;

  // Returns true if the table has all parts and vertices that a shape names.
  bool has_all_of(const Shape& shape) const;
};

// A shape in the world, or in another frame. `axes`: its rows are the shape's axes. `vertices`: of a hull, in its own
// frame.
struct Solid {
  const Shape* shape = nullptr;
  Vec3 centre;
  Mat3 axes;
  const Vec3* vertices = nullptr;

  Solid() = default;
  Solid(const Shape& placed, const BodyPose& frame, const Vec3* of_hull = nullptr);

  Vec3 to_own(const Vec3& p) const { return axes * (p - centre); }
  // Returns the farthest point of the core along a direction, both in the solid's own frame.
  Vec3 core_support(const Vec3& direction) const;
  // Returns the distance from the centre to the farthest point along a unit direction of the world.
  double extent_along(const Vec3& direction) const;
};

// A body's shape in the world: the frame of the `whole`, and the convex solids that it consists of.
struct BodySolid {
  Solid whole;
  std::vector<Solid> parts;

  // Returns the least height of its points along a unit vector [m].
  double lowest(const Vec3& up = {0.0, 0.0, 1.0}) const;
};

// Places a shape, which the table has all of, on a body.
void place_shape(const ShapeTable& table, const Shape& shape, const BodyPose& body, BodySolid& placed);

}  // namespace smartmesh
