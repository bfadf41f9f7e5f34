#include "shape/gjk.h"

#include <algorithm>

#include "math/triangle.h"

namespace smartmesh {

namespace {

constexpr int ITERATIONS = 32;
// Distance below which a triangle and a core count as overlapping [m].
constexpr double OVERLAP = 1e-9;
constexpr Vec3 ORIGIN{};

Vec3 farthest_corner(const Triangle& t, const Vec3& direction) {
  const double a = dot(t.a, direction), b = dot(t.b, direction), c = dot(t.c, direction);
  if (a >= b && a >= c) return t.a;
  return b >= c ? t.b : t.c;
}

// Returns the point of a segment nearest to the origin.
Vec3 on_segment(const Vec3& a, const Vec3& b) {
  return a + (b - a) * std::clamp(along_segment(ORIGIN, a, b), 0.0, 1.0);
}

// Returns true if the origin is on the other side of the plane through three points than `d`, or on the plane.
bool is_beyond(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  const Vec3 normal = cross(b - a, c - a);
  return dot(normal, a) * dot(normal, d - a) >= 0.0;
}

bool holds_origin(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return !(is_beyond(a, b, c, d) || is_beyond(a, b, d, c) || is_beyond(b, c, d, a) || is_beyond(c, a, d, b));
}

// Up to three support points, without the newest one.
struct Simplex {
  int count = 1;
  Vec3 a, b, c;

  // Adds a point and returns the nearest point to the origin; of four points the one opposite to it goes.
  Vec3 add(const Vec3& w) {
    if (count == 1) return count = 2, b = w, on_segment(a, w);
    if (count == 2) return count = 3, c = w, closest_point({a, b, w}, ORIGIN);
    const Vec3 p = closest_point({a, b, w}, ORIGIN), q = closest_point({b, c, w}, ORIGIN);
    const Vec3 r = closest_point({c, a, w}, ORIGIN);
    const double pp = norm2(p), qq = norm2(q), rr = norm2(r);
    if (pp <= qq && pp <= rr) return c = w, p;
    if (qq <= rr) return a = w, q;
    return b = w, r;
  }
};

}  // namespace

Separation separation_of(const Triangle& triangle, const Solid& solid, double limit) {
  const Vec3 nearest = closest_point(triangle, ORIGIN);
  Vec3 v = nearest - solid.core_support(nearest), d = ORIGIN;
  Simplex simplex{1, v, v, v};
  Separation best{0.0, ORIGIN};
  for (int k = 0; k < ITERATIONS; ++k) {
    const double length = norm(v);
    if (length < OVERLAP) return {0.0, d};
    d = v * (-1.0 / length);  // towards the origin: from the triangle to the core
    const Vec3 w = farthest_corner(triangle, d) - solid.core_support(-d);
    const double bound = -dot(w, d);  // a plane across d separates by so much
    if (bound > best.distance) best = {bound, d};
    if (best.distance > limit || length - best.distance <= CLOSE)
      return best.distance > 0.0 ? best : Separation{0.0, d};
    if (simplex.count == 3 && best.distance == 0.0 && holds_origin(simplex.a, simplex.b, simplex.c, w)) return {0.0, d};
    v = simplex.add(w);
  }
  return best;
}

}  // namespace smartmesh
