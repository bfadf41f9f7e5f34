// Attached bodies on the soil.
#pragma once

#include "bullet/attached.h"
#include "bullet/instant.h"

namespace smartmesh {

// Returns the body in a slot as the soil sees it now, in a step of some duration [s]. There must be soil.
OnSoil on_soil(const Instant& now, const Attached& attached, const Slot& slot, double step);

// Presses the soil, if there is any, to where the awake bodies are at the end of a step.
void press_soil(const Instant& now, Attached& attached);

}  // namespace smartmesh
