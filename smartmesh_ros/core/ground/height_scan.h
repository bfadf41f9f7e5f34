// Heights of the ground at a pattern of points around poses, as policies of legged robots observe it.
#pragma once

#include <cstddef>

#include "ground/tiles.h"

namespace smartmesh {

// Writes the heights (count, points) [m] of the highest ground at a pattern of points (points, 2) [m] in the frame of
// each pose (count, 3), position [m] and yaw [rad]; NaN = no ground. There is none around a pose whose numbers are
// larger than `farthest` or not finite.
void scan_heights(GroundReader& ground, const double* poses, std::size_t count, const double* pattern,
                  std::size_t points, double farthest, double* heights);

}  // namespace smartmesh
