// The shape of a ground proxy: the ground near one body, as Bullet sees it.
#pragma once

#include <BulletCollision/CollisionShapes/btConcaveShape.h>
#include <BulletCollision/CollisionShapes/btTriangleCallback.h>

#include "bullet/convert.h"

namespace smartmesh {

class BulletWorld;

// Type of the shape in Bullet's tables: a concave one that Bullet itself does not use. The one for custom shapes is
// that of signed distance fields, too, and Bullet's own algorithms cast it to one.
constexpr int GROUND_SHAPE_TYPE = FAST_CONCAVE_MESH_PROXYTYPE;

// Bounds follow the body; the tiles and the time are the world's. Contacts come from `GroundAlgorithm`; the triangles
// serve whatever else asks Bullet, such as shapes of unknown kinds, and rays where the ground is not drawn.
class GroundShape final : public btConcaveShape {
 public:
  GroundShape(BulletWorld* world, int of_slot) : slot(of_slot), world_(world) {
    m_shapeType = GROUND_SHAPE_TYPE;
    setMargin(0.0);
  }

  const int slot;  // of the body

  // Bounds of the ground in reach, in the proxy's frame.
  btVector3 low{0.0, 0.0, 0.0}, high{0.0, 0.0, 0.0};

  void getAabb(const btTransform& t, btVector3& least, btVector3& most) const override {
    const btVector3 centre = (low + high) * 0.5, half = (high - low) * 0.5;
    const btMatrix3x3 rotation = t.getBasis().absolute();
    const btVector3 extent(half.dot3(rotation[0], rotation[1], rotation[2])), at = t * centre;
    least = at - extent;
    most = at + extent;
  }
  void processAllTriangles(btTriangleCallback* callback, const btVector3& least, const btVector3& most) const override;

  const btVector3& getLocalScaling() const override { return scaling_; }
  void setLocalScaling(const btVector3&) override {}
  void calculateLocalInertia(btScalar, btVector3& inertia) const override { inertia.setValue(0.0, 0.0, 0.0); }
  const char* getName() const override { return "Ground"; }

  btVector3 origin{0.0, 0.0, 0.0};  // of the proxy in the world

 private:
  BulletWorld* world_;
  btVector3 scaling_{1.0, 1.0, 1.0};
};

}  // namespace smartmesh
