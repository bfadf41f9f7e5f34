// The shape that Bullet collides, part by part.
#pragma once

#include <map>
#include <vector>

#include "bullet/convert.h"

class btCollisionShape;
class btDiscreteDynamicsWorld;

namespace smartmesh {

// A convex part of a body's shape, in the frame of its centre of mass; `points`: of a hull, in that frame [m].
struct ShapePart {
  Shape shape;
  std::vector<Vec3> points;
};
using LinkShapes = std::map<int, std::vector<ShapePart>>;

// Returns the shapes of those links of a PyBullet body that have one, -1 = the base. A part whose kind is not known
// here is the ball about the centre of mass that holds it. Throws `std::invalid_argument` if the body is soft.
LinkShapes link_shapes(btDiscreteDynamicsWorld& world, int body);

}  // namespace smartmesh
