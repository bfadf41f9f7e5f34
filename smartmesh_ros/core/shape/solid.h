// Convex shapes, each a core (box, point, cylinder about z, segment along z, or hull of vertices) that is grown by a
// rounding radius; and shapes of bodies at their poses.
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

// Returns the pose of a shape in the frame of its `offset`.
inline Pose pose_of(const Shape& shape) { return {transpose(axes_of(shape.orientation)), shape.offset}; }

// A shape in the world, or in another frame. `axes`: its rows are the shape's axes.
struct Solid {
  const Shape* shape = nullptr;
  Vec3 centre;
  Mat3 axes;

  Solid() = default;
  Solid(const Shape& placed, const BodyPose& frame)
      : shape(&placed),
        centre(frame.at + rotated(frame.orientation, placed.offset)),
        axes(axes_of(frame.orientation * placed.orientation)) {}

  // Returns the distance from the centre to the farthest point along a unit direction of the world; see Shape::extent.
  double extent_along(const Vec3& direction) const { return shape->extent(axes * direction); }
  Vec3 half_extents() const {
    return {extent_along({1.0, 0.0, 0.0}), extent_along({0.0, 1.0, 0.0}), extent_along({0.0, 0.0, 1.0})};
  }
};

}  // namespace smartmesh
