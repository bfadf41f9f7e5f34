// Heights of the ground at a pattern of points around poses, as policies of legged robots observe it.
#pragma once

#include <cstddef>

#include "ground/tiles.h"

namespace smartmesh {

// Pose of a scan: position [m] and yaw [rad].
struct ScanPose {
  double x, y, yaw;
};

// Points (x, y) [m] in the frame of a pose: `points` (count, 2).
struct ScanPattern {
  const double* points;
  std::size_t count;

  // Returns the distance of the farthest point from the pose [m].
  double radius() const;
};

// Writes the heights (count,) [m] of the highest ground at the points of a pattern, whose radius is given; NaN = no
// ground.
void scan_heights(GroundReader& ground, const ScanPose& pose, const ScanPattern& pattern, double radius,
                  double* heights);

}  // namespace smartmesh
