#include "bullet/shape_parts.h"

#include <BulletCollision/CollisionShapes/btCompoundShape.h>
#include <BulletCollision/CollisionShapes/btConvexHullShape.h>
#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/world.h"

namespace smartmesh {

namespace {

Turn turn_of(const btTransform& pose) {
  const btQuaternion q = pose.getRotation();
  return {q.x(), q.y(), q.z(), q.w()};
}

// Returns the ball about the origin that holds the bounds of a shape at a pose.
ShapePart ball_around(const btCollisionShape& shape, const btTransform& pose) {
  btVector3 low, high;
  shape.getAabb(pose, low, high);
  btVector3 farthest = high.absolute();
  farthest.setMax(low.absolute());
  return {ball(farthest.length()), {}};
}

ShapePart hull_at(const btConvexHullShape& hull, const btTransform& pose) {
  ShapePart part;
  part.shape.kind = ShapeKind::Hull, part.shape.rounding = hull.getMargin();
  for (int k = 0; k < hull.getNumPoints(); ++k) part.points.push_back(from_bullet(pose * hull.getScaledPoint(k)));
  return part;
}

void add_parts(const btCollisionShape& shape, const btTransform& pose, std::vector<ShapePart>& parts) {
  if (shape.isCompound()) {
    const auto& compound = static_cast<const btCompoundShape&>(shape);
    for (int k = 0; k < compound.getNumChildShapes(); ++k)
      add_parts(*compound.getChildShape(k), pose * compound.getChildTransform(k), parts);
  } else if (shape.getShapeType() == CONVEX_HULL_SHAPE_PROXYTYPE) {
    parts.push_back(hull_at(static_cast<const btConvexHullShape&>(shape), pose));
  } else if (const auto convex =
                 shape.isConvex() ? convex_of(static_cast<const btConvexShape&>(shape)) : std::nullopt) {
    parts.push_back({*convex, {}});
    parts.back().shape.offset = from_bullet(pose.getOrigin());
    parts.back().shape.turn = turn_of(pose) * convex->turn;
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
    add_parts(*objects[k]->getCollisionShape(), btTransform::getIdentity(), parts);
    if (!parts.empty()) found[name.link] = std::move(parts);
  }
  return found;
}

}  // namespace smartmesh
