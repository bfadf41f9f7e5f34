#include "convert.h"

#include <algorithm>

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>

#include "hull_faces.h"

namespace smartmesh {

namespace {

// Distance up to which points count as one, in one plane or on one line, as a share of a hull's size. Above the rounding of
// meshes in single precision, below what contacts notice.
constexpr double SAME = 1e-6;
std::vector<Vec3> without_doubles(std::vector<Vec3> points, double tolerance) {
  std::sort(points.begin(), points.end(), [](const Vec3& a, const Vec3& b) { return a.x < b.x; });
  std::vector<Vec3> found;
  for (const Vec3& point : points) {
    bool is_new = true;
    for (auto k = found.rbegin(); is_new && k != found.rend() && point.x - k->x <= tolerance; ++k)
      is_new = norm2(point - *k) > tolerance * tolerance;
    if (is_new) found.push_back(point);
  }
  return found;
}

Convex hull_of_shape(const btConvexHullShape& shape) {
  std::vector<btVector3> points;
  for (int k = 0; k < shape.getNumPoints(); ++k) points.push_back(shape.getScaledPoint(k));
  return hull_of(points, shape.getMargin());
}

}  // namespace

Convex hull_of(const std::vector<btVector3>& points, double margin) {
  std::vector<Vec3> corners;
  for (const btVector3& point : points) corners.push_back(from_bullet(point));
  Bounds bounds;
  for (const Vec3& corner : corners) bounds.add(corner);
  const double tolerance = SAME * norm(bounds.high - bounds.low);
  corners = without_doubles(corners, tolerance);
  return hull(corners, hull_faces(corners, tolerance), margin);
}

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
      if (it.getNumPoints() == 0) return false;
      convex = hull_of_shape(it);
      return true;
    }
    default:
      return false;
  }
}

}  // namespace smartmesh
