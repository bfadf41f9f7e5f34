// Bodies that are below the ground.
#pragma once

#include "ground/tiles.h"

namespace smartmesh {

// Returns the ground above the `middle` of the shape of a PyBullet `body` at the instant of `reader`; height NaN if
// the middle is not below the ground, beside the decks that the body carries. Ground of meshes above the middle counts
// only where there is none below it. The centre of mass of a link is no measure: it may be beside the link's shape, and
// below the ground without harm.
GroundPoint ground_above(GroundReader& reader, const Vec3& middle, int body);

}  // namespace smartmesh
