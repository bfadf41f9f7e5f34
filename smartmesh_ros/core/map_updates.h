// Taking maps of moving ground: new heights, and velocities estimated from them.
#pragma once

#include "clock_updates.h"
#include "height_grid.h"

namespace smartmesh {

// New `heights` [m] of a rectangle at `time` [s], row by row, and their `velocities` [m/s], null = not given. `deviation`
// [m]: standard deviation of the heights, none = the usual one.
struct NewSamples {
  const float* heights;
  const float* velocities;
  double time;
  std::optional<double> deviation;
};

// Writes new samples to a `place` of a map of moving ground. Velocities are difference quotients, or given. They are
// written to the ring buffer; other samples of the touched blocks are at rest for that interval. An update of a part of a
// block less than `intervals.least` after the last one corrects it. An update so soon, or soon compared to the intervals
// before, is merged: the newest velocity then is the mean over both intervals.
void take_heights(HeightGrid& map, const Region& place, const NewSamples& samples);

}  // namespace smartmesh
