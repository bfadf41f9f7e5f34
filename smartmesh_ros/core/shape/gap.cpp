// Source of the closest point of a triangle: Ericson, Real-Time Collision Detection (2005), 5.1.5.
#include "shape/gap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "shape/gjk.h"

namespace smartmesh {

namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();

}  // namespace

Vec3 closest_point(const Triangle& t, const Vec3& p) {
  const Vec3 ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a, bp = p - t.b, cp = p - t.c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0.0 && d2 <= 0.0) return t.a;
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0.0 && d4 <= d3) return t.b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return t.a + ab * (d1 / (d1 - d3));
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0.0 && d5 <= d6) return t.c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return t.a + ac * (d2 / (d2 - d6));
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) return t.b + (t.c - t.b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  const double share = 1.0 / (va + vb + vc);
  return t.a + ab * (vb * share) + ac * (vc * share);
}

double distance_of_point(const Vec3& p, const Solid& solid) {
  const Vec3 own = solid.to_own(p);
  return std::max(0.0, separation_of({own, own, own}, solid, INFINITE).distance - solid.shape->rounding);
}

}  // namespace smartmesh
