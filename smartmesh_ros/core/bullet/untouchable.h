// Bodies that nothing touches but rays meet, which PyBullet's groups and masks cannot say.
#pragma once

#include <BulletCollision/BroadphaseCollision/btOverlappingPairCache.h>

class btCollisionObject;
class btDiscreteDynamicsWorld;

namespace smartmesh {

bool is_untouchable(const btCollisionObject& object);

// Asked by the world for each pair of bodies; all other pairs are decided as before.
class UntouchableFilter final : public btOverlapFilterCallback {
 public:
  // Lets nothing touch an object of the world from now on. The object's shape remembers it.
  void keep_apart(btDiscreteDynamicsWorld& world, btCollisionObject& object);
  // Gives the decision back.
  void leave(btDiscreteDynamicsWorld& world);

  bool needBroadphaseCollision(btBroadphaseProxy* a, btBroadphaseProxy* b) const override;

 private:
  btOverlapFilterCallback* others_ = nullptr;  // PyBullet's, which lives as long as the world
};

}  // namespace smartmesh
