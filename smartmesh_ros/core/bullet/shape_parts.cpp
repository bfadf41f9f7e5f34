#include "bullet/shape_parts.h"

#include <stdexcept>

#include <BulletCollision/CollisionShapes/btBoxShape.h>
#include <BulletCollision/CollisionShapes/btCapsuleShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletCollision/CollisionShapes/btCylinderShape.h>
#include <BulletCollision/CollisionShapes/btSphereShape.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include "bullet/objects.h"

namespace smartmesh {

namespace {

// Returns a shape along z, laid along another axis. PyBullet makes none of these, but reads them from files of
// Bullet's.
Convex along_axis(Convex shape, int axis) {
  shape.orientation = FROM_Z[axis];
  return shape;
}

// Returns the ball about the origin that holds the bounds of a shape at a pose.
ShapePart ball_around(const btCollisionShape& shape, const btTransform& pose) {
  btVector3 low, high;
  shape.getAabb(pose, low, high);
  btVector3 farthest = high.absolute();
  farthest.setMax(low.absolute());
  return primitive_part(ShapeKind::Ball, {}, farthest.length(), {});
}

std::vector<Vec3> points_of(const btConvexHullShape& hull, const btTransform& pose) {
  std::vector<Vec3> points;
  for (int k = 0; k < hull.getNumPoints(); ++k) points.push_back(from_bullet(pose * hull.getScaledPoint(k)));
  return points;
}

void add_part(const btCollisionShape& shape, const btTransform& pose, std::vector<ShapePart>& parts) {
  if (shape.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    const auto& hull = static_cast<const btConvexHullShape&>(shape);
    if (hull.getNumPoints() > 0) parts.push_back(hull_part(points_of(hull, pose), hull.getMargin()));
  } else if (const auto convex =
                 shape.isConvex() ? convex_of(static_cast<const btConvexShape&>(shape)) : std::nullopt) {
    const auto [at, orientation] = body_pose(pose);
    parts.push_back(
        primitive_part(convex->kind, convex->half, convex->rounding, {at, orientation * convex->orientation}));
  } else if (shape.getShapeType() != EMPTY_SHAPE_PROXYTYPE) {
    parts.push_back(ball_around(shape, pose));
  }
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
      if (it.getNumPoints() == 0) return {};
      return hull(points_of(it, btTransform::getIdentity()), it.getMargin());
    }
    default:
      return {};
  }
}

std::map<int, BodyShape> link_shapes(btDiscreteDynamicsWorld& world, int body) {
  std::map<int, BodyShape> found;
  const auto& objects = world.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const ObjectName name = name_of(*objects[k]);
    if (name.body != body) continue;
    require_attachable(*objects[k]);
    std::vector<ShapePart> parts;
    for_each_part(*objects[k]->getCollisionShape(), btTransform::getIdentity(),
                  [&](const btCollisionShape& part, const btTransform& pose) { add_part(part, pose, parts); });
    if (!parts.empty()) found.emplace(name.link, std::move(parts));
  }
  return found;
}

void require_convex_if_moved(const btCollisionObject& object) {
  if (object.isStaticOrKinematicObject()) return;
  for_each_part(
      *object.getCollisionShape(), btTransform::getIdentity(), [](const btCollisionShape& part, const btTransform&) {
        if (part.isConvex() || part.getShapeType() == EMPTY_SHAPE_PROXYTYPE) return;
        throw std::invalid_argument(
            "it has a shape that is not convex, and only convex ones collide with the map; load the mesh without "
            "GEOM_FORCE_CONCAVE_TRIMESH, or without concave=\"yes\"");
      });
}

}  // namespace smartmesh
