#include "bullet/broadphase.h"

#include <algorithm>
#include <vector>

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

namespace smartmesh {

namespace {

// Where new proxies wait, apart from each other, for the bounds of their objects [m].
constexpr double FAR_AWAY = 1e15, APART = 1e6;

btBroadphaseProxy* new_proxy(btDiscreteDynamicsWorld& world, int place, btCollisionObject* object, int group,
                             int mask) {
  const btVector3 at(FAR_AWAY + place * APART, 0.0, 0.0);
  const int kind = object == nullptr ? EMPTY_SHAPE_PROXYTYPE : object->getCollisionShape()->getShapeType();
  return world.getBroadphase()->createProxy(at, at, kind, object, group, mask, world.getDispatcher());
}

}  // namespace

void renew_broadphase(btDiscreteDynamicsWorld& world) {
  btBroadphaseInterface& broadphase = *world.getBroadphase();
  btDispatcher* dispatcher = world.getDispatcher();
  auto& objects = world.getCollisionObjectArray();
  struct Known {
    btCollisionObject* object;
    int number, group, mask;
  };
  std::vector<Known> known;
  for (int k = 0; k < objects.size(); ++k) {
    btBroadphaseProxy* proxy = objects[k]->getBroadphaseHandle();
    if (proxy == nullptr) continue;
    known.push_back({objects[k], proxy->m_uniqueId, proxy->m_collisionFilterGroup, proxy->m_collisionFilterMask});
    broadphase.destroyProxy(proxy, dispatcher);
  }
  broadphase.resetPool(dispatcher);
  std::sort(known.begin(), known.end(), [](const Known& a, const Known& b) { return a.number < b.number; });
  // Objects keep their numbers, by which PyBullet's own saved states know them; Bullet gives one after the other.
  int number = 0;
  for (const Known& it : known) {
    while (++number < it.number) broadphase.destroyProxy(new_proxy(world, 0, nullptr, 0, 0), dispatcher);
    it.object->setBroadphaseHandle(new_proxy(world, number, it.object, it.group, it.mask));
  }
}

}  // namespace smartmesh
