// Bodies that left the ground and fall, because there is none under them.
#pragma once

#include <vector>

#include "bullet/attached.h"
#include "bullet/instant.h"

namespace smartmesh {

// Slots of bodies that began to fall, and of those that are lost.
struct Falls {
  std::vector<int> begun, lost;
};

// Looks at the awake bodies of this world's own for ground over or under them at an instant [s]. A body falls that is
// below the last ground by more than its radius, and is lost below it by more than a `depth` [m].
Falls check_falls(const Instant& now, Attached& attached, double time, double depth);
std::vector<int> find_falling(const Attached& attached);

// Returns the slots of awake bodies that are at no place or farther away than some distance [m].
std::vector<int> find_nowhere(const Attached& attached, double farthest);

}  // namespace smartmesh
