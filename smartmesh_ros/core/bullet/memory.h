// What a saved state has of the ground in a Bullet world, beside contacts.
#pragma once

#include <vector>

#include "bullet/slot.h"

namespace smartmesh {

// What a slot knows of the past, as numbers of Python; see Rest and Slot.
struct SlotMemory {
  double still = 0.0;
  Pose anchor;
  Vec3 pull, ground_angular, last_ground;
  double falls = 0.0;
};
static_assert(sizeof(SlotMemory) == 23 * sizeof(double));

SlotMemory memory_of(const Slot& slot);
void recall(Slot& slot, const SlotMemory& memory);

// Returns what a slot knows of its parts on the soil, as numbers; and takes it over, false if it is none of this body.
std::vector<double> parts_memory(const Slot& slot, const SoilInStep* soil);
bool recall_parts(Slot& slot, const SoilInStep* soil, const double* numbers, std::size_t count);

}  // namespace smartmesh
