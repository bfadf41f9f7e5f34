// Taking maps of moving ground: new heights, and velocities estimated from them.
#pragma once

#include "map/clock_updates.h"
#include "map/map_region.h"

namespace smartmesh {

// New `heights` [m] of a rectangle at `time` [s], row by row, and their `velocities` [m/s], null = not given.
struct NewSamples {
  const float* heights;
  const float* velocities;
  double time;
};

// Writes new samples to a `place` of a map. Velocities are difference
// quotients, or given. They are written to the ring buffer; other samples of the touched blocks are at rest for that
// interval. An update of a part of a block less than `intervals.least` after the last one corrects it. An update so
// soon, or soon compared to the intervals before, is merged: the newest velocity then is the mean over both intervals.
void take_heights(HeightGrid& map, const Region& place, const NewSamples& samples, const Intervals& intervals);

}  // namespace smartmesh
