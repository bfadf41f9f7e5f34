// A body or link of Bullet's that carries something: its motion, and what an impulse does to it.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>

#include "bullet/convert.h"
#include "ground/frame_motion.h"

namespace smartmesh {

// Returns the velocity of the centre of mass of a body or link, and its angular velocity.
FrameVelocity velocity_of(const btCollisionObject& object);

// Returns by how much the velocity of a point of a body or link changes along a unit vector, by an impulse at the point
// along that vector [1/kg]; zero if it does not move by physics.
double yield_of(const btCollisionObject& object, const Vec3& point, const Vec3& along);

// Lets a body know its inertia as it lies now: a robot knows it from its last step, a rigid body from before PyBullet's
// `restoreState`.
void renew_inertia(btCollisionObject& object);

// Applies an impulse [N s] at a point of a body or link that moves by physics, after a step of `duration` [s]: as if it
// had acted in that step.
void push(btCollisionObject& object, const Vec3& point, const Vec3& impulse, double duration);

}  // namespace smartmesh
