// Notices that Bullet asks for the bounds of its objects, before each collision query and in each step.
#pragma once

#include <functional>

#include <BulletCollision/CollisionShapes/btEmptyShape.h>

class btCollisionObject;
class btDiscreteDynamicsWorld;

namespace smartmesh {

// Height of what has no bounds, far below everything [m].
constexpr double FAR_BELOW = -1e6;

// The shape of an object that collides with nothing, and which is no body of PyBullet.
class BoundsHook final : public btEmptyShape {
 public:
  explicit BoundsHook(std::function<void()> ask) : ask_(std::move(ask)) {}

  // Enters a world, which deletes the object at its end.
  void enter(btDiscreteDynamicsWorld& world);

  void getAabb(const btTransform&, btVector3& low, btVector3& high) const override;

 private:
  std::function<void()> ask_;
  bool is_in_ = false;
};

}  // namespace smartmesh
