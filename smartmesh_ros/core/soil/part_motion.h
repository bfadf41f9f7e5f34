// Motion of a part of a body in the soil within a step: its tilts and its heave as one Vec3, about x, about y, upwards.
// So are velocities [rad/s, rad/s, m/s], ways [rad, rad, m] and loads [N m, N m, N].
//
// Pressures do not turn what rolls about its own axis. In place of that tilt stands its way across the axis, which they
// do change: of a ball in place of both tilts.
#pragma once

#include "soil/soil_rim.h"

namespace smartmesh {

// Returns true if a part rolls: here it turns about its own axis alone.
inline bool rolls(const Solid& solid) { return solid.shape->kind == ShapeKind::Ball || lies(solid); }

// Returns the tilts of a rotation and the heave of a way [m], or of their rates: of what rolls, with the way across its
// axis.
Vec3 tilts_and_heave(const Solid& solid, const Vec3& rotation, const Vec3& way);
// Returns the inertia against tilts and heave of a part of some mass [kg] that fills the part's box evenly.
Mat3 inertia_of(const Solid& solid, double mass);
// Returns the load of a unit force along a normal at a point, whose `offset` is from the middle of the part [m]. The
// same numbers say how far each tilt and the heave move the point along the normal.
inline Vec3 lever_at(const Solid& solid, const Vec3& offset, const Vec3& normal) {
  return tilts_and_heave(solid, cross(offset, normal), normal);
}
inline Vec3 velocity_of(const MovingSolid& moving) {
  return tilts_and_heave(moving.solid, moving.angular, moving.linear);
}

}  // namespace smartmesh
