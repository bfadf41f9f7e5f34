#include "convert.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>

namespace smartmesh {

bool convex_of(const btConvexShape& shape, Convex& convex) {
  switch (shape.getShapeType()) {
    case SPHERE_SHAPE_PROXYTYPE:
      convex = ball(static_cast<const btSphereShape&>(shape).getRadius());
      return true;
    case BOX_SHAPE_PROXYTYPE:
      convex = box(from_bullet(static_cast<const btBoxShape&>(shape).getHalfExtentsWithMargin()));
      return true;
    case CAPSULE_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btCapsuleShape&>(shape);
      convex = capsule(it.getRadius(), it.getHalfHeight());
      return it.getUpAxis() == 2;
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btCylinderShape&>(shape);
      const btVector3 half = it.getHalfExtentsWithMargin();
      convex = cylinder(half.x(), half.z());
      return it.getUpAxis() == 2;
    }
    case CONVEX_HULL_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btConvexHullShape&>(shape);
      std::vector<Vec3> points;
      for (int k = 0; k < it.getNumPoints(); ++k) points.push_back(from_bullet(it.getScaledPoint(k)));
      if (!points.empty()) convex = hull(points, it.getMargin());
      return !points.empty();
    }
    default:
      return false;
  }
}

}  // namespace smartmesh
