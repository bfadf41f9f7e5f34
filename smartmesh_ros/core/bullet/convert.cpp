#include "bullet/convert.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>

namespace smartmesh {

namespace {

// Returns a shape along z, laid along another axis. PyBullet makes none of these, but reads them from files of
// Bullet's.
Convex along_axis(Convex shape, int axis) {
  shape.orientation = FROM_Z[axis];
  return shape;
}

}  // namespace

std::optional<Convex> convex_of(const btConvexShape& shape) {
  switch (shape.getShapeType()) {
    case SPHERE_SHAPE_PROXYTYPE:
      return ball(static_cast<const btSphereShape&>(shape).getRadius());
    case BOX_SHAPE_PROXYTYPE:
      return box(from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin()));
    case CAPSULE_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btCapsuleShape&>(shape);
      return along_axis(capsule(it.getRadius(), it.getHalfHeight()), it.getUpAxis());
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btCylinderShape&>(shape);
      const btVector3 half = it.getHalfExtentsWithMargin();
      return along_axis(cylinder(half[(it.getUpAxis() + 1) % 3], half[it.getUpAxis()]), it.getUpAxis());
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btConvexHullShape&>(shape);
      std::vector<Vec3> points;
      for (int k = 0; k < it.getNumPoints(); ++k) points.push_back(from_bullet(it.getScaledPoint(k)));
      if (points.empty()) return {};
      return hull(points, it.getMargin());
    }
    default:
      return {};
  }
}

}  // namespace smartmesh
