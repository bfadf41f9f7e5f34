// What all of a step reads.
#pragma once

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include "bullet/convert.h"
#include "bullet/soil_in_step.h"
#include "ground/tiles.h"

namespace smartmesh {

// A Bullet world and its ground at the start of the next step. `drawn`: rays meet other bodies that stand for the
// ground. `stepping`: Bullet takes the step, for which it has applied gravity.
struct Instant {
  btDiscreteDynamicsWorld& world;
  Tiles* terrain;              // belongs to Python
  SoilInStep* soil = nullptr;  // belongs to Python; null = none
  double time = 0.0;           // [s]
  double duration = 0.0;       // of a step [s]
  double margin = 0.001;       // distance up to which contacts are found beside the motion of a step [m]
  bool drawn = false, stepping = false;

  // Returns `margin` and the way that gravity adds to the motion of a body in a step.
  double margin_in(double step) const { return margin + world.getGravity().length() * step * step; }
};

}  // namespace smartmesh
