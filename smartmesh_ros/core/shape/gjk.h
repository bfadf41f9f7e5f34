// Distance between a triangle and the core of a convex solid, by GJK.
//
// Their Minkowski difference contains the origin if they overlap; otherwise its point nearest to the origin gives
// distance and direction. The point is found on a growing and shrinking simplex of support points (Gilbert, Johnson and
// Keerthi, 1988; van den Bergh, Collision Detection in Interactive 3D Environments, 2003, 4.3).
#pragma once

#include "shape/gap.h"

namespace smartmesh {

// `distance` [m]: between a triangle and a core, a lower bound within `CLOSE`; zero if they overlap. `normal`: unit
// direction from the triangle to the core; if they overlap, the last direction that was tried, zero if none was.
struct Separation {
  double distance;
  Vec3 normal;
};

// Returns how far a triangle in the frame of a convex solid is from its core, without its rounding. `limit` [m] as in
// `gap_between`.
Separation separation_of(const Triangle& triangle, const Solid& solid, double limit);

}  // namespace smartmesh
