#include "bullet/shape_parts.h"

#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/world.h"

namespace smartmesh {

namespace {

Quaternion orientation_of(const btTransform& pose) {
  const btQuaternion q = pose.getRotation();
  return {q.x(), q.y(), q.z(), q.w()};
}

// Returns the ball about the origin that holds the bounds of a shape at a pose.
ShapePart ball_around(const btCollisionShape& shape, const btTransform& pose) {
  btVector3 low, high;
  shape.getAabb(pose, low, high);
  btVector3 farthest = high.absolute();
  farthest.setMax(low.absolute());
  ShapePart part{ball(farthest.length()), {}};
  part.shape.radius = part.shape.bounding_radius;
  return part;
}

ShapePart hull_at(const btConvexHullShape& hull, const btTransform& pose) {
  ShapePart part;
  part.shape.kind = ShapeKind::Hull, part.shape.rounding = hull.getMargin();
  for (int k = 0; k < hull.getNumPoints(); ++k) part.points.push_back(from_bullet(pose * hull.getScaledPoint(k)));
  return part;
}

void add_part(const btCollisionShape& shape, const btTransform& pose, std::vector<ShapePart>& parts) {
  if (shape.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    parts.push_back(hull_at(static_cast<const btConvexHullShape&>(shape), pose));
  } else if (const auto convex =
                 shape.isConvex() ? convex_of(static_cast<const btConvexShape&>(shape)) : std::nullopt) {
    parts.push_back({*convex, {}});
    Shape& placed = parts.back().shape;
    placed.offset = from_bullet(pose.getOrigin()), placed.orientation = orientation_of(pose) * convex->orientation;
    placed.radius = placed.bounding_radius + norm(placed.offset);
  } else if (shape.getShapeType() != EMPTY_SHAPE_PROXYTYPE) {
    parts.push_back(ball_around(shape, pose));
  }
}

}  // namespace

LinkShapes link_shapes(btDiscreteDynamicsWorld& world, int body) {
  LinkShapes found;
  const auto& objects = world.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const ObjectName name = name_of(*objects[k]);
    if (name.body != body) continue;
    require_rigid(*objects[k]);
    std::vector<ShapePart> parts;
    for_each_part(*objects[k]->getCollisionShape(), btTransform::getIdentity(),
                  [&](const btCollisionShape& part, const btTransform& pose) { add_part(part, pose, parts); });
    if (!parts.empty()) found[name.link] = std::move(parts);
  }
  return found;
}

}  // namespace smartmesh
