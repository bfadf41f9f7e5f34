// Bodies that are below the ground.
#pragma once

#include "ground/tiles.h"

namespace smartmesh {

// Returns the ground above a point `inside` a part of a PyBullet `body` at the instant of `reader`; height NaN if the
// point is not below the ground, beside the decks that the body carries. Ground of meshes above the point counts only
// where there is none below it. The centre of mass of a link is no measure, nor is the middle of what bounds it: they
// may be beside the link's shape, and below the ground without harm.
GroundPoint ground_above(GroundReader& reader, const Vec3& inside, int body);

}  // namespace smartmesh
