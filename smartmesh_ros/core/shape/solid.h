// Shapes of bodies at their poses.
#pragma once

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
