#include "soil/part_motion.h"

namespace smartmesh {

namespace {

// Returns the level direction of the own axis of what lies.
Vec3 axis_of(const Solid& solid) {
  const Vec3& own = solid.axes.row[2];
  return unit({own.x, own.y, 0.0});
}

}  // namespace

Vec3 tilts_and_heave(const Solid& solid, const Vec3& rotation, const Vec3& way) {
  if (solid.shape->kind == ShapeKind::Ball) return way;
  const Vec3 found{rotation.x, rotation.y, way.z};
  if (!rolls(solid)) return found;
  const Vec3 axis = axis_of(solid);
  return found + axis * (dot(way, Vec3{axis.y, -axis.x, 0.0}) - dot(axis, rotation));
}

Mat3 inertia_of(const Solid& solid, double mass) {
  const Shape& shape = *solid.shape;
  if (shape.kind == ShapeKind::Ball) return {{{mass, 0.0, 0.0}, {0.0, mass, 0.0}, {0.0, 0.0, mass}}};
  Mat3 found{{{}, {}, {0.0, 0.0, mass}}};
  const Vec3 half{shape.extent({1.0, 0.0, 0.0}), shape.extent({0.0, 1.0, 0.0}), shape.extent({0.0, 0.0, 1.0})};
  for (int k = 0; k < 3; ++k) {
    const Vec3 axis{solid.axes.row[k].x, solid.axes.row[k].y, 0.0};
    const double own = mass / 3.0 * (norm2(half) - component(half, k) * component(half, k));
    found.row[0] = found.row[0] + axis * (own * axis.x), found.row[1] = found.row[1] + axis * (own * axis.y);
  }
  if (!rolls(solid)) return found;
  const Vec3 axis = axis_of(solid), across{-axis.y, axis.x, 0.0};
  const double turns = dot(across, found * across);
  for (int k = 0; k < 2; ++k)
    found.row[k] = axis * (mass * component(axis, k)) + across * (turns * component(across, k));
  return found;
}

}  // namespace smartmesh
