// Objects of a Bullet world, as PyBullet knows them.
#pragma once

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/convert.h"

namespace smartmesh {

// PyBullet's numbers of a body and its link, -1 = the base; `body` is -1 for what PyBullet did not make.
struct ObjectName {
  int body, link;
};
ObjectName name_of(const btCollisionObject& object);
// Returns the object with a name; null if there is none.
btCollisionObject* find_object(btDiscreteDynamicsWorld& world, const ObjectName& name);
// Throws `std::invalid_argument` if a body is soft, or is joined to bodies that PyBullet gave no number, as the links
// of a URDF that was loaded with useMaximalCoordinates.
void require_attachable(btCollisionObject& object);

// Returns the robot that an object is a link of; null if it is none.
btMultiBody* robot_of(btCollisionObject& object);
// Calls `apply` for the colliders of all links of a robot that physics moves.
template <class Apply>
void for_each_collider(btMultiBody& robot, Apply apply) {
  for (int link = -1; link < robot.getNumLinks(); ++link) {
    btMultiBodyLinkCollider* collider = link < 0 ? robot.getBaseCollider() : robot.getLinkCollider(link);
    if (collider != nullptr && !collider->isStaticOrKinematicObject()) apply(*collider);
  }
}

// Returns the bounds of an object as Bullet knows them.
inline Bounds bounds_of(const btCollisionObject& object) {
  const btBroadphaseProxy& proxy = *object.getBroadphaseHandle();
  return {from_bullet(proxy.m_aabbMin), from_bullet(proxy.m_aabbMax)};
}
// Returns the bounding radius of an object about its centre of mass [m].
double bounding_radius(const btCollisionObject& object);
// Returns the mass of a rigid body, or of a robot with all its links [kg].
double mass_of(const btCollisionObject& object);

}  // namespace smartmesh
