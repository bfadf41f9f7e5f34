// The part of a convex shape that is below a plane, as the plane sees it.
#pragma once

#include <vector>

#include "shape/convex.h"

namespace smartmesh {

// The points p with dot(normal, p) = offset; `normal`: unit.
struct Plane {
  Vec3 normal;
  double offset;
};

// A point of a plane above a part of a shape that is below it, in the shape's frame: how deep the shape goes there [m],
// and the area that the point stands for [m^2].
struct DepthSample {
  Vec3 point;
  double depth, area;
};

// Finds samples of all that is below a plane of a shape, in the shape's frame: in 12 rows of 12, each as long as the
// shape is there.
void sample_below(const Convex& shape, const Plane& plane, std::vector<DepthSample>& samples);

}  // namespace smartmesh
