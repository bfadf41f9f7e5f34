// Distances of points from a convex hull.
#pragma once

#include "shape/convex.h"

namespace smartmesh {

// Returns the distance of a point from the core of a hull [m], zero inside; a flat hull has no inside.
double distance_outside(const Polytope& hull, const Vec3& p);

}  // namespace smartmesh
