// Corrections of static ground: new estimates of its heights, blended in over a short time.
#pragma once

#include "map/map_region.h"

namespace smartmesh {

// New estimate of the `heights` [m] of a rectangle at `time` [s], row by row. It is blended in within the time `settle`
// [s] from the instant `shown` [s] on, up to which corrections are blended in; infinity = nothing is shown yet.
struct NewEstimate {
  const float* heights;
  double time, shown, settle;
};

// Writes a new estimate to a `place` of a map. The offsets are set so that the shown heights do not jump. A filled hole
// takes the offset of the sample before it in its row, because a different offset would be a spike.
void take_corrected(HeightGrid& map, const Region& place, const NewEstimate& estimate);

}  // namespace smartmesh
