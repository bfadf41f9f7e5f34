// Points and triangles.
#pragma once

#include "vec3.h"

namespace smartmesh {

// Share of an edge by which a point outside a triangle still counts as inside, against gaps by rounding.
constexpr double ON_EDGE = 1e-9;

// Returns true if `q`, a point of the plane of the triangle (a, b, c) with unit normal `n`, lies inside it, or outside by
// at most `slack` [m].
inline bool inside_triangle(const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& n, double slack) {
  const auto left = [&](const Vec3& p, const Vec3& r) {
    const Vec3 u = r - p;
    const double length2 = norm2(u), side = dot(cross(u, q - p), n);
    if (side >= 0.0) return true;
    const double limit = slack + ON_EDGE * std::sqrt(length2);
    return side * side <= limit * limit * length2;
  };
  return left(a, b) && left(b, c) && left(c, a);
}

// Returns true if the vertical through `p` meets the triangle (a, b, c).
inline bool is_over(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const auto left = [&](const Vec3& q, const Vec3& r) {
    return (r.x - q.x) * (p.y - q.y) - (r.y - q.y) * (p.x - q.x) >= 0.0;
  };
  return left(a, b) && left(b, c) && left(c, a);
}

// Returns the share of the way from `a` to `b` at which their line is nearest to `p`.
inline double along_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 u = b - a;
  const double length2 = norm2(u);
  return length2 > 0.0 ? dot(p - a, u) / length2 : 0.0;
}

// Nearest points of two lines: shares `s` of the way from a to b and `t` of the way from p to q. False = parallel.
inline bool nearest_on_lines(const Vec3& a, const Vec3& b, const Vec3& p, const Vec3& q, double& s, double& t) {
  const Vec3 u = b - a, v = q - p, w = a - p;
  const double uu = norm2(u), vv = norm2(v), uv = dot(u, v), uw = dot(u, w), vw = dot(v, w);
  const double area = uu * vv - uv * uv;
  if (!(area > 1e-12 * uu * vv)) return false;
  s = (uv * vw - vv * uw) / area;
  t = (uu * vw - uv * uw) / area;
  return true;
}

}  // namespace smartmesh
