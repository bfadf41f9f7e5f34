// Normal cones of features: the directions in which the ground or a shape is touched by something convex.
#pragma once

#include "convex.h"
#include "patch.h"

namespace smartmesh {

// Sine of the angle by which a direction may leave a cone. Between flat facets a cone is a single direction, which
// rounding must not miss; a body that slides over flat ground gains at most this share of its speed.
constexpr double CONE_TOLERANCE = 1e-4;

// Returns true if the ground lies below the plane through `p` with normal `n` as far as point `other` tells.
inline bool is_below(const Vec3& n, const Vec3& p, const Vec3& other) {
  const Vec3 d = other - p;
  const double rise = dot(n, d);
  return rise <= 0.0 || rise * rise <= CONE_TOLERANCE * CONE_TOLERANCE * norm2(d);
}

inline bool in_cone(const Patch& patch, const Edge& edge, const Vec3& n) {
  const Vec3& a = patch.points[edge.end[0]];
  for (int k : edge.opposite)
    if (k >= 0 && !is_below(n, a, patch.points[k])) return false;
  return true;
}

inline bool in_cone(const Patch& patch, const Peak& peak, const Vec3& n) {
  const Vec3& p = patch.points[peak.point];
  for (int k = peak.first; k < peak.first + peak.count; ++k)
    if (!is_below(n, p, patch.points[patch.neighbours[k]])) return false;
  return true;
}

// Returns true if a shape with this edge is touched from direction `n` (in the shape's frame, into the shape).
inline bool in_cone(const PolyEdge& edge, const Vec3& n) {
  for (int k = 0; k < 2; ++k)
    if (edge.faces[k] >= 0 && dot(n, edge.into[k]) < -CONE_TOLERANCE) return false;
  return true;
}

// Returns true if a shape with this vertex is touched from direction `n` (in the shape's frame, into the shape).
inline bool in_cone(const Polytope& core, int vertex, const Vec3& n) {
  for (int k : core.neighbours[vertex])
    if (!is_below(-n, core.vertices[vertex], core.vertices[k])) return false;
  return true;
}

}  // namespace smartmesh
