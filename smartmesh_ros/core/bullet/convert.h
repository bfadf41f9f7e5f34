// Between Bullet's types and the core's.
#pragma once

#include <LinearMath/btTransform.h>

#include "shape/solid.h"

namespace smartmesh {

inline Vec3 from_bullet(const btVector3& v) { return {v.x(), v.y(), v.z()}; }
inline btVector3 to_bullet(const Vec3& v) { return btVector3(v.x, v.y, v.z); }
inline Pose from_bullet(const btTransform& t) {
  const btMatrix3x3& m = t.getBasis();
  return {{{from_bullet(m[0]), from_bullet(m[1]), from_bullet(m[2])}}, from_bullet(t.getOrigin())};
}
inline BodyPose body_pose(const btTransform& t) {
  const btQuaternion q = t.getRotation();
  return {from_bullet(t.getOrigin()), {q.x(), q.y(), q.z(), q.w()}};
}

}  // namespace smartmesh
