// The gap between a triangle and a body.
#pragma once

#include "solid.h"

namespace smartmesh {

struct Triangle {
  Vec3 a, b, c;
};

// Returns the point of a triangle closest to `p`.
Vec3 closest_point(const Triangle& triangle, const Vec3& p);

// `distance` [m]: between a triangle and a body, or minus the depth of their overlap. `nearest`: the triangle's point
// nearest to the centre of that convex part of the body which is nearest.
struct Gap {
  double distance;
  Vec3 nearest;
};

// Largest error of a distance, which is never too large [m].
constexpr double CLOSE = 1e-6;

// Returns the gap between a triangle and a body. A distance above `limit` [m] may be less than the true one, but stays
// above the limit: a search for the nearest triangle needs only the smallest gap so far. The depth of an overlap is exact
// for balls and boxes; for others it may be too large.
Gap gap_between(const Triangle& triangle, const BodySolid& body, double limit);

// Returns the distance of a point from a convex solid [m], zero inside.
double distance_of_point(const Vec3& p, const Solid& solid);

}  // namespace smartmesh
