// Velocities of the links of a multibody now; Bullet keeps those of the last step only.
#pragma once

#include <BulletDynamics/Featherstone/btMultiBody.h>

#include "math/vec3.h"

namespace smartmesh {

struct LinkVelocity {
  Vec3 linear, angular;  // of the link's centre of mass, in the world [m/s], [rad/s]
};

// Returns the velocity of a link (-1 = the base), from the velocities of the base and of the joints on the way to it.
LinkVelocity link_velocity(const btMultiBody& body, int link);

}  // namespace smartmesh
