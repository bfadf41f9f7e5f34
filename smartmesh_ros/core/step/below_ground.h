// Bodies that are below the ground.
#pragma once

#include "ground/surface.h"

namespace smartmesh {

// Returns the ground above the `middle` of the shape of a PyBullet `body` at the instant of `surface`; height NaN if
// the middle is not below the ground, beside the decks that the body carries. Ground of meshes above the middle counts
// only where there is none below it. The centre of mass of a link is no measure: it may be beside the link's shape, and
// below the ground without harm.
GroundPoint ground_above(SurfaceReader& surface, const Vec3& middle, int body);

}  // namespace smartmesh
