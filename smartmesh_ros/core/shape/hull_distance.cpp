// Source of the closest point of a triangle: Ericson, Real-Time Collision Detection (2005), 5.1.5.
#include "shape/hull_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

struct Triangle {
  Vec3 a, b, c;
};

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

}  // namespace

// The nearest point is on a face that is seen from outside.
double distance_outside(const Polytope& hull, const Vec3& p) {
  const bool is_solid = hull.faces.size() > 2;
  double least = std::numeric_limits<double>::infinity();
  for (const PolyFace& face : hull.faces) {
    if (is_solid && dot(face.normal, p) <= face.offset) continue;
    const auto corner = [&](int k) { return hull.vertices[hull.loops[face.first + k]]; };
    for (int k = 1; k + 1 < face.count; ++k)
      least = std::min(least, norm(p - closest_point({corner(0), corner(k), corner(k + 1)}, p)));
  }
  if (is_solid) return std::isinf(least) ? 0.0 : least;
  for (const Vec3& vertex : hull.vertices) least = std::min(least, norm(p - vertex));
  for (const PolyEdge& edge : hull.edges) {
    const Triangle line{hull.vertices[edge.end[0]], hull.vertices[edge.end[1]], hull.vertices[edge.end[1]]};
    least = std::min(least, norm(p - closest_point(line, p)));
  }
  return least;
}

}  // namespace smartmesh
