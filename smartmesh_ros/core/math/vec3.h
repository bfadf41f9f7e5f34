// Vectors, rotations and poses in three dimensions.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();  // what is not there, or not known

struct Vec3 {
  double x = 0.0, y = 0.0, z = 0.0;
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(const Vec3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline Vec3 operator*(double s, const Vec3& a) { return a * s; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
// Returns the component of a vector along x, y or z.
inline double component(const Vec3& v, int axis) { return axis == 0 ? v.x : axis == 1 ? v.y : v.z; }
inline double norm2(const Vec3& a) { return dot(a, a); }
inline double norm(const Vec3& a) { return std::sqrt(norm2(a)); }

// Returns the unit vector along `a`; a zero vector stays zero.
inline Vec3 unit(const Vec3& a) {
  const double length = norm(a);
  return length > 0.0 ? a * (1.0 / length) : a;
}

// Returns the part of a vector that is perpendicular to a unit vector.
inline Vec3 perpendicular(const Vec3& v, const Vec3& axis) { return v - axis * dot(v, axis); }

// Rotation by its rows.
struct Mat3 {
  Vec3 row[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
};

inline Vec3 operator*(const Mat3& m, const Vec3& v) { return {dot(m.row[0], v), dot(m.row[1], v), dot(m.row[2], v)}; }

// Returns the product of the transposed matrix and `v`, which for a rotation is the inverse rotation of `v`.
inline Vec3 transposed(const Mat3& m, const Vec3& v) { return m.row[0] * v.x + m.row[1] * v.y + m.row[2] * v.z; }

inline Mat3 transpose(const Mat3& m) {
  const Vec3 &a = m.row[0], &b = m.row[1], &c = m.row[2];
  return {{{a.x, b.x, c.x}, {a.y, b.y, c.y}, {a.z, b.z, c.z}}};
}

inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {{transposed(b, a.row[0]), transposed(b, a.row[1]), transposed(b, a.row[2])}};
}

inline Mat3 operator*(const Mat3& m, double factor) {
  return {{m.row[0] * factor, m.row[1] * factor, m.row[2] * factor}};
}

// Returns the solution of a system of equations with a symmetric matrix.
inline Vec3 solve(const Mat3& m, const Vec3& right) {
  const auto& [a, b, c] = m.row;
  const Vec3 ab = cross(a, b), bc = cross(b, c), ca = cross(c, a);
  return (bc * right.x + ca * right.y + ab * right.z) * (1.0 / dot(a, bc));
}

// Pose of a frame in another: `rotation` and `at` of its axes and its origin there.
struct Pose {
  Mat3 rotation;
  Vec3 at;

  Vec3 to_world(const Vec3& local) const { return rotation * local + at; }
  Vec3 to_local(const Vec3& world) const { return transposed(rotation, world - at); }
};

// Returns the pose in the world of a frame at `local` in another.
inline Pose operator*(const Pose& frame, const Pose& local) {
  return {frame.rotation * local.rotation, frame.to_world(local.at)};
}
// Returns the pose of a frame as seen from another.
inline Pose seen_from(const Pose& frame, const Pose& world) {
  return {transpose(frame.rotation) * world.rotation, frame.to_local(world.at)};
}

// Axis-aligned box from `low` to `high`.
struct Bounds {
  Vec3 low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};

  void add(const Vec3& p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  // Returns what two boxes have in common.
  Bounds common(const Bounds& other) const {
    return {{std::max(low.x, other.low.x), std::max(low.y, other.low.y), std::max(low.z, other.low.z)},
            {std::min(high.x, other.high.x), std::min(high.y, other.high.y), std::min(high.z, other.high.z)}};
  }
  // Returns the bounds of a box that moves by a way.
  Bounds swept(const Vec3& way) const {
    Bounds found = *this;
    found.add(low + way), found.add(high + way);
    return found;
  }
  Bounds grown(double by) const { return {low - Vec3{by, by, by}, high + Vec3{by, by, by}}; }
  bool contains(const Bounds& other) const {
    return (low.x <= other.low.x) & (other.high.x <= high.x) & (low.y <= other.low.y) & (other.high.y <= high.y) &
           (low.z <= other.low.z) & (other.high.z <= high.z);
  }
  // All comparisons are made, because which one fails first is anybody's guess, also the processor's.
  bool meets(const Bounds& other) const {
    return (low.x <= other.high.x) & (other.low.x <= high.x) & (low.y <= other.high.y) & (other.low.y <= high.y) &
           (low.z <= other.high.z) & (other.low.z <= high.z);
  }
};

// Returns the bounds of a box that is mapped by a matrix.
inline Bounds operator*(const Mat3& m, const Bounds& box) {
  const Mat3 columns = transpose(m);
  Bounds x, y, z;
  x.add(columns.row[0] * box.low.x), x.add(columns.row[0] * box.high.x);
  y.add(columns.row[1] * box.low.y), y.add(columns.row[1] * box.high.y);
  z.add(columns.row[2] * box.low.z), z.add(columns.row[2] * box.high.z);
  return {x.low + y.low + z.low, x.high + y.high + z.high};
}

}  // namespace smartmesh
