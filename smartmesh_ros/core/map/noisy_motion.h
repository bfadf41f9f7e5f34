// Motion of a sample of a height map whose heights are noisy: each velocity is shrunk by the share that noise explains.
//
// Without this filter, noise of 1 mm at 60 Hz becomes velocity noise of 8 cm/s, and the ground throws bodies. Noise
// differs between neighbouring samples, while motion hardly does. So the velocity of a sample is split into the mean of
// the samples around it and the deviation from that mean. Each part is multiplied by the share of its power that noise
// of the known variance does not explain, as in Lee's filter (*Digital Image Enhancement and Noise Filtering by Use of
// Local Statistics*, 1980). Unlike there, the mean is shrunk too, so that static ground stays at rest.
#pragma once

#include "map/height_grid.h"

namespace smartmesh {

// Returns the motion of a sample of a block with this `clock` and `phase`. The clock's newest velocity must be one of
// those stored.
Motion motion_in_noise(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase);

}  // namespace smartmesh
