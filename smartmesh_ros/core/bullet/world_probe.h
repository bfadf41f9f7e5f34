// What the core reads in Bullet's memory, for a check that it was compiled for the PyBullet that runs.
#pragma once

#include <vector>

#include "bullet/slot.h"

namespace smartmesh {

// What the ground reads of a world's solver: `duration` [s] of the last step, shares of a penetration and of a friction
// anchor's distance that a step corrects, and the penetration [m] that is left.
struct SolverSettings {
  Vec3 gravity;
  double duration, erp, friction_erp, slop;
};
SolverSettings settings_of(btDiscreteDynamicsWorld& world);

// Returns the contacts of a proxy in the last step.
std::vector<OldContact> contacts_of(btDiscreteDynamicsWorld& world, const btCollisionObject& proxy);

}  // namespace smartmesh
