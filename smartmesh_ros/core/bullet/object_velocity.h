// Velocities of Bullet's objects, also of the links of robots.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

#include "ground/frame_motion.h"

namespace smartmesh {

// Returns the velocity of the centre of mass of a body or link, and its angular velocity.
FrameVelocity velocity_of(const btCollisionObject& object);

}  // namespace smartmesh
