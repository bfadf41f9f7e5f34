#include "bullet/untouchable.h"

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

namespace smartmesh {

namespace {

char untouchable;  // its address marks shapes

bool is_of_untouchable(const btBroadphaseProxy& bounds) {
  return is_untouchable(*static_cast<const btCollisionObject*>(bounds.m_clientObject));
}

}  // namespace

bool is_untouchable(const btCollisionObject& object) {
  return object.getCollisionShape()->getUserPointer() == &untouchable;
}

void UntouchableFilter::keep_apart(btDiscreteDynamicsWorld& world, btCollisionObject& object) {
  btOverlappingPairCache& pairs = *world.getPairCache();
  if (pairs.getOverlapFilterCallback() != this) {
    others_ = pairs.getOverlapFilterCallback();
    pairs.setOverlapFilterCallback(this);
  }
  object.getCollisionShape()->setUserPointer(&untouchable);
  pairs.removeOverlappingPairsContainingProxy(object.getBroadphaseHandle(), world.getDispatcher());
}

void UntouchableFilter::leave(btDiscreteDynamicsWorld& world) {
  btOverlappingPairCache& pairs = *world.getPairCache();
  if (pairs.getOverlapFilterCallback() == this) pairs.setOverlapFilterCallback(others_);
}

bool UntouchableFilter::needBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const {
  if (is_of_untouchable(*a) || is_of_untouchable(*b)) return false;
  if (others_ != nullptr) return others_->needBroadphaseCollision(a, b);
  return (a->m_collisionFilterGroup & b->m_collisionFilterMask) &&
         (b->m_collisionFilterGroup & a->m_collisionFilterMask);
}

}  // namespace smartmesh
