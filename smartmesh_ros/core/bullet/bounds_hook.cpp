#include "bullet/bounds_hook.h"

#include <BulletCollision/CollisionDispatch/btCollisionObject.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

namespace smartmesh {

void BoundsHook::enter(btDiscreteDynamicsWorld& world) {
  is_in_ = false;
  auto* object = new btCollisionObject();
  object->setCollisionShape(this);
  object->setCollisionFlags(btCollisionObject::CF_STATIC_OBJECT | btCollisionObject::CF_NO_CONTACT_RESPONSE);
  object->setActivationState(DISABLE_DEACTIVATION);  // Bullet asks for the bounds of active objects
  world.addCollisionObject(object, 0, 0);
  is_in_ = true;
}

void BoundsHook::getAabb(const btTransform&, btVector3& low, btVector3& high) const {
  low = high = btVector3(0.0, 0.0, FAR_BELOW);
  if (is_in_) ask_();
}

}  // namespace smartmesh
