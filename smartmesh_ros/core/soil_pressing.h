// How far bodies press the soil down in an update.
//
// The samples under a body take the form of its underside, moved down and leant so that the pressures of the samples,
// each by its own sinkage and sinking speed, have the force and the moments of the body's contacts.
#pragma once

#include <vector>

#include "soil_balance.h"
#include "soil_foot.h"

namespace smartmesh {

// Space that the search for each body uses again.
struct PressingScratch {
  FootRow row;
  std::vector<UnderSample> samples;
  std::vector<PatchSoil> soils;
};

// Presses a body into the soil.
void press(SoilGround& ground, Foot& foot, const SoilUpdate& update, PressingScratch& scratch);

}  // namespace smartmesh
