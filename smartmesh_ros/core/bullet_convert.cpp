#include "bullet_convert.h"

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <LinearMath/btConvexHullComputer.h>

namespace smartmesh {

namespace {

Vec3 axis_of(int index) { return {index == 0 ? 1.0 : 0.0, index == 1 ? 1.0 : 0.0, index == 2 ? 1.0 : 0.0}; }

Convex hull_of_shape(const btConvexHullShape& shape) {
  std::vector<btVector3> points;
  for (int k = 0; k < shape.getNumPoints(); ++k) points.push_back(shape.getScaledPoint(k));
  return hull_of(points, shape.getMargin());
}

}  // namespace

Convex hull_of(const std::vector<btVector3>& points, double margin) {
  btConvexHullComputer computer;
  computer.compute(&points[0].x(), sizeof(btVector3), static_cast<int>(points.size()), 0.0, 0.0);
  std::vector<Vec3> corners;
  for (int k = 0; k < computer.vertices.size(); ++k)  // of the input, because the computer rounds
    corners.push_back(from_bullet(points[computer.original_vertex_index[k]]));
  std::vector<std::vector<int>> loops;
  for (int f = 0; f < computer.faces.size(); ++f) {
    const auto* first = &computer.edges[computer.faces[f]];
    const auto* edge = first;
    std::vector<int> loop;
    do {
      loop.push_back(edge->getSourceVertex());
      edge = edge->getNextEdgeOfFace();
    } while (edge != first);
    loops.push_back(loop);
  }
  return hull(corners, loops, margin);
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
      convex = capsule(it.getRadius(), it.getHalfHeight(), axis_of(it.getUpAxis()));
      return true;
    }
    case CYLINDER_SHAPE_PROXYTYPE: {
      const auto& it = static_cast<const btCylinderShape&>(shape);
      const btVector3 half = it.getHalfExtentsWithMargin();
      convex = cylinder(half[(it.getUpAxis() + 1) % 3], half[it.getUpAxis()], axis_of(it.getUpAxis()));
      return true;
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
