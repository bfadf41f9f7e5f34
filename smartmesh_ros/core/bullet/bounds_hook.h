// Notices that Bullet asks for the bounds of its objects, before each collision query and in each step.
#pragma once

#include <functional>

#include <BulletCollision/CollisionShapes/btCollisionShape.h>

class btCollisionObject;
class btDiscreteDynamicsWorld;

namespace smartmesh {

// Height of what has no bounds, far below everything [m].
constexpr double FAR_BELOW = -1e6;

// The shape of an object that collides with nothing, and which is no body of PyBullet.
class BoundsHook final : public btCollisionShape {
 public:
  explicit BoundsHook(std::function<void()> ask) : ask_(std::move(ask)) { m_shapeType = EMPTY_SHAPE_PROXYTYPE; }

  // Enters a world, which deletes the object at its end.
  void enter(btDiscreteDynamicsWorld& world);

  void getAabb(const btTransform&, btVector3& low, btVector3& high) const override;
  void setLocalScaling(const btVector3&) override {}
  const btVector3& getLocalScaling() const override { return scaling_; }
  void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setValue(0.0, 0.0, 0.0); }
  const char* getName() const override { return "BoundsHook"; }
  void setMargin(btScalar) override {}
  btScalar getMargin() const override { return 0.0; }

 private:
  std::function<void()> ask_;
  bool is_in_ = false;
  btVector3 scaling_{1.0, 1.0, 1.0};
};

}  // namespace smartmesh
