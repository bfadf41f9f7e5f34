// Samples of a height map under the boxes of bodies.
#pragma once

#include "map_arrays.h"

namespace smartmesh {

// Returns the samples around a box on a map in a pose, without rows or columns if the box is beside the map.
Region samples_around(const HeightGrid& grid, const GridPose& pose, const Bounds& box);

// Returns the number of updates so far of the blocks under a box; -1 if the ground may move there at `time` [s].
std::int64_t updates_under(const HeightGrid& grid, const GridPose& pose, const Bounds& box, double time);

// Writes the positions (x, y) [m] of the samples of a rectangle, row by row.
void write_positions(const HeightGrid& grid, const GridPose& pose, const Region& samples, double* positions);

}  // namespace smartmesh
