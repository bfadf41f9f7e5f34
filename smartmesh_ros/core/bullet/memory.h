// What a saved state has of the ground in a Bullet world, beside contacts.
#pragma once

#include <vector>

#include "bullet/slot.h"

namespace smartmesh {

// Returns what a slot knows of its parts on the soil, as numbers; and takes it over, false if it is none of this body.
std::vector<double> parts_memory(const Slot& slot, const SoilInStep* soil);
bool recall_parts(Slot& slot, const SoilInStep* soil, const double* numbers, std::size_t count);

}  // namespace smartmesh
