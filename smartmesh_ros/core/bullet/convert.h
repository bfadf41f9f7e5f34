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
inline btTransform to_bullet(const Pose& pose) {
  const Vec3(&r)[3] = pose.rotation.row;
  const btMatrix3x3 basis(r[0].x, r[0].y, r[0].z, r[1].x, r[1].y, r[1].z, r[2].x, r[2].y, r[2].z);
  return btTransform(basis, to_bullet(pose.at));
}
inline BodyPose body_pose(const btTransform& t) {
  const btQuaternion q = t.getRotation();
  return {from_bullet(t.getOrigin()), {q.x(), q.y(), q.z(), q.w()}};
}

}  // namespace smartmesh
