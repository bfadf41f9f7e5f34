// Bullet's collision algorithm between convex shapes and the ground.
#pragma once

#include <BulletCollision/CollisionDispatch/btCollisionCreateFunc.h>

class btDiscreteDynamicsWorld;

namespace smartmesh {

class BulletWorld;

// Lets the dispatcher of a Bullet world ask a ground for contacts with its proxies. Must live as long as that world.
class GroundAlgorithms final : public btCollisionAlgorithmCreateFunc {
 public:
  explicit GroundAlgorithms(BulletWorld* ground) : ground_(ground) {}
  void enter(btDiscreteDynamicsWorld& world);
  bool are_in(const btDiscreteDynamicsWorld& world) const;

  btCollisionAlgorithm* CreateCollisionAlgorithm(btCollisionAlgorithmConstructionInfo& info,
                                                 const btCollisionObjectWrapper* a,
                                                 const btCollisionObjectWrapper* b) override;

 private:
  BulletWorld* ground_;
};

}  // namespace smartmesh
