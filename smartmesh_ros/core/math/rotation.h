// Rotations as unit quaternions.
#pragma once

#include "math/vec3.h"

namespace smartmesh {

struct Quaternion {
  double x = 0.0, y = 0.0, z = 0.0, w = 1.0;

  Quaternion inverse() const { return {-x, -y, -z, w}; }
};

// Returns the rotation `b` followed by `a`.
inline Quaternion operator*(const Quaternion& a, const Quaternion& b) {
  return {a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
          a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

inline double dot(const Quaternion& a, const Quaternion& b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }

inline Vec3 rotated(const Quaternion& q, const Vec3& v) {
  const Vec3 axis{q.x, q.y, q.z}, twice = cross(axis, v) * 2.0;
  return v + twice * q.w + cross(axis, twice);
}

// Returns the rotation whose rows are the axes of a frame turned by `q`.
inline Mat3 axes_of(const Quaternion& q) {
  return {{rotated(q, {1.0, 0.0, 0.0}), rotated(q, {0.0, 1.0, 0.0}), rotated(q, {0.0, 0.0, 1.0})}};
}

// Returns the smallest rotation of a unit vector to another, which is not opposite.
inline Mat3 rotation_between(const Vec3& from, const Vec3& to) {
  const Vec3 axis = cross(from, to);
  const double w = 1.0 + dot(from, to), length = std::sqrt(norm2(axis) + w * w);
  return transpose(axes_of({axis.x / length, axis.y / length, axis.z / length, w / length}));
}

// Orientations of what is along z, laid along x, y and z.
constexpr Quaternion FROM_Z[3] = {{0.5, 0.5, 0.5, 0.5}, {-0.5, -0.5, -0.5, 0.5}, {0.0, 0.0, 0.0, 1.0}};

}  // namespace smartmesh
