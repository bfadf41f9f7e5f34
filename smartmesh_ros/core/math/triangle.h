// Points and triangles.
#pragma once

#include "math/vec3.h"

namespace smartmesh {

// Share of an edge by which a point outside a triangle still counts as inside, against gaps by rounding.
constexpr double ON_EDGE = 1e-9;

// Returns true if `q`, a point of the plane of the triangle (a, b, c) with unit normal `n`, lies inside it, or outside
// by at most `slack` [m].
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

// Finds the barycentric weights of the point of the triangle (a, b, c) with unit normal `n` that is nearest to `p`.
// Returns its squared distance from `p` [m^2].
inline double nearest_weights(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& n,
                              double (&weights)[3]) {
  const Vec3* const corner[3] = {&a, &b, &c};
  const double area = dot(cross(b - a, c - a), n);
  bool is_inside = true;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &q = *corner[(k + 1) % 3], &r = *corner[(k + 2) % 3];
    weights[k] = dot(cross(r - q, p - q), n) / area;
    is_inside &= weights[k] >= 0.0;
  }
  if (is_inside) return dot(n, p - a) * dot(n, p - a);
  double least = 1e300;
  for (int k = 0; k < 3; ++k) {
    const Vec3 &q = *corner[(k + 1) % 3], &r = *corner[(k + 2) % 3];
    const double t = std::clamp(along_segment(p, q, r), 0.0, 1.0), distance2 = norm2(q + (r - q) * t - p);
    if (distance2 >= least) continue;
    least = distance2;
    weights[k] = 0.0, weights[(k + 1) % 3] = 1.0 - t, weights[(k + 2) % 3] = t;
  }
  return least;
}

}  // namespace smartmesh
