// The ground at points as sensors see it: the surface that bodies stand on.
#pragma once

#include <limits>

#include "surface.h"

namespace smartmesh {

// The ground at a point: height [m], NaN = none, unit normal towards the side of the bodies, velocity [m/s] with horizontal
// motion, and age [s], the time since the last map of the place, negative before it.
struct GroundSample {
  double height = std::numeric_limits<double>::quiet_NaN();
  Vec3 normal, velocity;
  double age = std::numeric_limits<double>::quiet_NaN();
};

// Returns the highest ground of maps and meshes that is not above `p`, at the instant of a reader.
GroundSample ground_below(SurfaceReader& reader, const Vec3& p);

}  // namespace smartmesh
