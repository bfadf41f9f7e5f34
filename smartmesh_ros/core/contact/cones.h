// Normal cones of features: the directions in which the ground or a shape is touched by something convex.
#pragma once

#include "contact/contact.h"

namespace smartmesh {

// Sine of the angle by which a direction may leave a cone. Between flat facets a cone is a single direction, which
// rounding must not miss; a body that slides over flat ground gains at most this share of its speed.
constexpr double CONE_TOLERANCE = 1e-4;

// The same for pairs on which a shape is seated: a face on a sample or on an edge of the ground that leads out of it,
// an edge on a facet that it leaves. Such a place stays where it is when the shape rocks by this sine: raising it holds
// shapes calmer on crests, but lets deep contacts push more askew.
constexpr double SEAT = 0.02;

// Returns the sine of the angle by which the normal `n` of two features at a `distance` [m] may leave their cones.
// Features that are apart may turn into their cones within the step; those that overlap may leave them by `seat`.
inline double cone_slack(const Approach& approach, const Vec3& n, double distance, double seat = CONE_TOLERANCE) {
  if (distance <= -approach.margin) return seat;
  const double slack = CONE_TOLERANCE + approach.angle_after_impact(n);
  return distance > 0.0 ? slack : std::max(seat, slack);
}

// Returns true if the ground lies below the plane through `p` with normal `n` as far as point `other` tells.
// `slack`: sine.
inline bool is_below(const Vec3& n, const Vec3& p, const Vec3& other, double slack) {
  const Vec3 d = other - p;
  const double height = dot(n, d);
  return height <= 0.0 || height * height <= slack * slack * norm2(d);
}

// `n`: perpendicular to the edge.
inline bool in_cone(const Patch& patch, const Edge& edge, const Vec3& n, double slack) {
  const Vec3 &a = patch.points[edge.end[0]], along = patch.points[edge.end[1]] - a;
  for (int k : edge.opposite) {
    if (k < 0) continue;
    const Vec3 d = patch.points[k] - a;
    const double height = dot(n, d);
    if (height > 0.0 && height * height * norm2(along) > slack * slack * norm2(cross(along, d))) return false;
  }
  return true;
}

inline bool in_cone(const Patch& patch, const Peak& peak, const Vec3& n, double slack) {
  const Vec3& p = patch.points[peak.point];
  for (int k = peak.first; k < peak.first + peak.count; ++k)
    if (!is_below(n, p, patch.points[patch.neighbours[k]], slack)) return false;
  return true;
}

// Returns true if a shape with this edge is touched from direction `n` (in the shape's frame, into the shape).
inline bool in_cone(const PolyEdge& edge, const Vec3& n, double slack) {
  for (int k = 0; k < 2; ++k)
    if (edge.faces[k] >= 0 && dot(n, edge.into[k]) < -slack) return false;
  return true;
}

// Returns true if a shape with this vertex is touched from direction `n` (in the shape's frame, into the shape).
inline bool in_cone(const Polytope& core, int vertex, const Vec3& n, double slack) {
  for (int k : core.neighbours[vertex])
    if (!is_below(-n, core.vertices[vertex], core.vertices[k], slack)) return false;
  return true;
}

}  // namespace smartmesh
