// Motion of a sample of a height map, also where the heights are noisy.
#pragma once

#include "height_grid.h"

namespace smartmesh {

// Returns the motion of a sample. On noisy maps each velocity is shrunk by the share that noise explains (Lee's filter),
// see terrain/noisy_motion.py.
Motion motion_at(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase);

}  // namespace smartmesh
