// Soil that recovers, flows to the rim and slides down.
#pragma once

#include "soil_foot.h"

namespace smartmesh {

// Unloads the samples that the body has left: they recover their elastic sinkage.
void recover(SoilGround& ground, const SampleRectangle& seen, std::int32_t number);

// Distributes the volume that a body displaced over the samples around it that were never pressed; if there are none,
// over all without load.
void move_to_rim(SoilGround& ground, const Foot& foot, const SoilUpdate& update);

// Moves soil between neighbouring samples without load that are steeper than the angle of repose, at least one of which
// was touched.
void slide_down(SoilGround& ground, const SampleRectangle& rectangle, const SoilUpdate& update);

}  // namespace smartmesh
