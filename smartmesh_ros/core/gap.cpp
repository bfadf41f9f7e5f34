// Source of the closest point of a triangle: Ericson, Real-Time Collision Detection (2005), 5.1.5. Of the axes along which
// a box and a triangle are apart: Akenine-Möller, Fast 3D Triangle-Box Overlap Testing (2001).
#include "gap.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gjk.h"

namespace smartmesh {

namespace {

// Smallest squared length of a cross product of edges that counts as an axis [m^2]. Those of nearly parallel edges are
// rounding noise.
constexpr double PARALLEL = 1e-12;
constexpr double INFINITE = std::numeric_limits<double>::infinity();

// Returns the larger of the signed distances between a triangle and a convex solid, beyond it along a unit axis and along
// the opposite direction.
double apart_along(const Triangle& t, const Solid& solid, const Vec3& axis) {
  const double a = dot(axis, t.a), b = dot(axis, t.b), c = dot(axis, t.c), at = dot(axis, solid.centre);
  return std::max(at - std::max({a, b, c}) - solid.reach_along(-axis), std::min({a, b, c}) - at - solid.reach_along(axis));
}

// Returns the signed distance of a triangle and a convex solid that overlap, or nearly: the largest along the triangle's
// normal, the solid's axes, the cross products of these with the edges, and two directions from the triangle to the solid:
// `outward` from its point nearest to the solid's centre, and `last`, in which they were apart.
double overlap(const Triangle& t, const Solid& solid, const Vec3& outward, const Vec3& last) {
  double most = -INFINITE;
  const auto try_axis = [&](const Vec3& axis, double least) {
    const double length2 = norm2(axis);
    if (length2 > least) most = std::max(most, apart_along(t, solid, axis * (1.0 / std::sqrt(length2))));
  };
  try_axis(cross(t.b - t.a, t.c - t.a), 0.0);
  try_axis(outward, 0.0), try_axis(last, 0.0);
  if (solid.shape->kind == ShapeKind::Ball) return most > -INFINITE ? most : -solid.shape->rounding;
  for (const Vec3& axis : solid.axes.row) {
    try_axis(axis, 0.0);
    for (const Vec3& edge : {t.b - t.a, t.c - t.b, t.a - t.c}) try_axis(cross(axis, edge), PARALLEL);
  }
  return most;
}

double distance_to(const Triangle& t, const Solid& solid, const Vec3& nearest, double limit) {
  const Triangle own{solid.to_own(t.a), solid.to_own(t.b), solid.to_own(t.c)};
  const Separation core = separation_of(own, solid, std::max(limit, 0.0) + solid.shape->rounding);
  if (core.distance > 0.0) return core.distance - solid.shape->rounding;
  return overlap(t, solid, solid.centre - nearest, transposed(solid.axes, core.normal));
}

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

Gap gap_between(const Triangle& triangle, const BodySolid& body, double limit) {
  Gap best{INFINITE, body.whole.centre};
  for (const Solid& part : body.parts) {
    const Vec3 nearest = closest_point(triangle, part.centre);
    const double least = std::min(limit, best.distance), around = norm(nearest - part.centre) - part.shape->reach;
    const double distance = around > least ? around : distance_to(triangle, part, nearest, least);
    if (distance < best.distance) best = {distance, nearest};
  }
  return best;
}

}  // namespace smartmesh
