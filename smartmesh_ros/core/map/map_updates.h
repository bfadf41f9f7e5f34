// Taking maps: of moving ground new heights, and velocities estimated from them; of static ground corrections, new
// estimates of its heights, blended in over a short time.
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

// Writes new samples to a `place` of a map. Velocities are difference quotients, or given. They are written to the ring
// buffer; other samples of the touched blocks are at rest for that interval. An update of a part of a block less than
// `intervals.least` after the last one corrects it. An update so soon, or soon compared to the intervals before, is
// merged: the newest velocity then is the mean over both intervals.
void take_heights(HeightGrid& map, const Region& place, const NewSamples& samples, const Intervals& intervals);

// Writes a new estimate of the `heights` [m] of a `place` of a map at `time` [s], row by row. It is blended in within
// the map's time to settle from the instant that is shown on. The offsets are set so that the shown heights do not
// jump. A filled hole takes the offset of the sample before it in its row, because a different offset would be a spike.
void take_corrected(HeightGrid& map, const Region& place, const float* heights, double time);

// Fuses repeated height measurements of static ground: a Kalman filter with one state per sample, see
// terrain/corrections.py. Updates `count` samples: `heights` [m], NaN = not measured yet, and their `variances` [m^2].
// `measured` [m]: NaN = not seen, which keeps the height. `noises` [m^2]: variances of the measurements; zero replaces
// the height, and a height whose variance is negative or not finite is ignored. `grown` [m^2]: variance since the last
// measurements. `gate_squared`: square of the gate [standard deviations] beyond which a sample restarts from the
// measurement.
void fuse(float* heights, float* variances, const float* measured, const float* noises, std::size_t count, float grown,
          float gate_squared);

}  // namespace smartmesh
