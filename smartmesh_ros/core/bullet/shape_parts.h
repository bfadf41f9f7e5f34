// The shape that Bullet collides, part by part.
#pragma once

#include <map>
#include <optional>

#include <BulletCollision/CollisionShapes/btCompoundShape.h>

#include "bullet/convert.h"
#include "shape/body_shape.h"
#include "shape/convex.h"

class btCollisionObject;
class btConvexShape;
class btDiscreteDynamicsWorld;

namespace smartmesh {

// Calls `use(part, pose)` for the parts of a shape at a pose.
template <class Use>
void for_each_part(const btCollisionShape& shape, const btTransform& pose, const Use& use) {
  if (!shape.isCompound()) return use(shape, pose);
  const auto& compound = static_cast<const btCompoundShape&>(shape);
  for (int k = 0; k < compound.getNumChildShapes(); ++k)
    for_each_part(*compound.getChildShape(k), pose * compound.getChildTransform(k), use);
}

// Returns the shape that Bullet collides, with its margin, rotated by `orientation` in Bullet's frame of it; none if
// its kind is not known here.
std::optional<Convex> convex_of(const btConvexShape& shape);

// Returns the shapes of those links of a PyBullet body that have one, -1 = the base. A part whose kind is not known
// here is the ball about the centre of mass that holds it. Throws as `require_attachable` does.
std::map<int, BodyShape> link_shapes(btDiscreteDynamicsWorld& world, int body);

// Throws `std::invalid_argument` if physics moves an object of which a part is not convex: nothing of such a part would
// touch the ground.
void require_convex_if_moved(const btCollisionObject& object);

}  // namespace smartmesh
