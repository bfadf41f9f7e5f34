// Bodies that left the ground and fall, because there is none under them.
#pragma once

#include <utility>
#include <vector>

#include "bullet/attached.h"
#include "bullet/instant.h"

namespace smartmesh {

// Looks at the awake bodies of this world's own for ground over or under them at an instant [s], and returns the slots
// of those that began to fall, and of those that are lost. A body falls that is below the last ground by more than its
// radius, and is lost below it by more than a `depth` [m].
std::pair<std::vector<int>, std::vector<int>> check_falls(const Instant& now, Attached& attached, double time,
                                                          double depth);

// Returns the slots of bodies that were removed from PyBullet, and of awake ones that are at no place or farther away
// than some distance [m].
std::vector<int> find_nowhere(const Attached& attached, double farthest);

}  // namespace smartmesh
