// Distances between points and triangles or convex solids.
#pragma once

#include "shape/solid.h"

namespace smartmesh {

struct Triangle {
  Vec3 a, b, c;
};

// Returns the point of a triangle closest to `p`.
Vec3 closest_point(const Triangle& triangle, const Vec3& p);

// Largest error of a distance, which is never too large [m].
constexpr double CLOSE = 1e-6;

// Returns the distance of a point from a convex solid [m], zero inside.
double distance_of_point(const Vec3& p, const Solid& solid);

}  // namespace smartmesh
