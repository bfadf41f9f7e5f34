// Convex shapes: a core (box, point, cylinder about z, segment along z, or hull of vertices), grown by a rounding
// radius.
#pragma once

#include <cstdint>

#include "math/rotation.h"

namespace smartmesh {

// Numbered as in smartmesh_msgs/TrackedBody and BodyDescription.
enum class ShapeKind : std::int64_t { Box = 1, Ball = 2, Cylinder = 3, Capsule = 6, Hull = 8, Compound = 9 };

inline bool is_primitive(ShapeKind kind) {
  return kind == ShapeKind::Box || kind == ShapeKind::Ball || kind == ShapeKind::Cylinder || kind == ShapeKind::Capsule;
}

// `half` extents of the core along the shape's axes, and `rounding` radius [m]. `offset` [m], `orientation`: pose of
// the shape, in the frame of a body's centre of mass. `bounding_radius` [m]: about the shape's middle.
struct Shape {
  ShapeKind kind = ShapeKind::Ball;
  Vec3 half;
  double rounding = 0.0;
  Vec3 offset;
  Quaternion orientation;
  double bounding_radius = 0.0;

  // Returns the distance from the middle to the farthest point along a unit direction in the shape's own frame [m]; of
  // hulls and compounds that of the box around them.
  double extent(const Vec3& d) const {
    if (kind == ShapeKind::Cylinder)
      return half.x * std::sqrt(d.x * d.x + d.y * d.y) + half.z * std::abs(d.z) + rounding;
    return half.x * std::abs(d.x) + half.y * std::abs(d.y) + half.z * std::abs(d.z) + rounding;
  }
};

}  // namespace smartmesh
