// Bullet's broadphase without its past.
#pragma once

class btDiscreteDynamicsWorld;

namespace smartmesh {

// Height of what has no bounds, far below everything [m].
constexpr double FAR_BELOW = -1e6;

// Makes the broadphase of a world anew: it forgets all pairs of objects, their contacts, and how objects moved. Pairs
// are then found in an order that is that of the objects; it is the order of contacts in the solver, and so decides on
// the last bits of a step.
void renew_broadphase(btDiscreteDynamicsWorld& world);

}  // namespace smartmesh
