// Bodies that are below the ground.
#pragma once

#include "solid.h"
#include "surface.h"

namespace smartmesh {

// How far a body must be lifted until its lowest point is on the ground [m], and the ground's vertical velocity [m/s].
struct Lift {
  bool is_below = false;
  double height = 0.0, velocity = 0.0;
};

// Returns true if the middle of a body's shape is below the ground at the instant of `surface`, and how it gets out. Ground of meshes
// above the middle counts only where there is none below it. The centre of mass of a link is no measure: it may be beside
// the link's shape, and below the ground without harm.
Lift lift_out(SurfaceReader& surface, const BodySolid& body);

}  // namespace smartmesh
