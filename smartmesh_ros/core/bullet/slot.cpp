#include "bullet/slot.h"

#include <algorithm>

#include <BulletCollision/CollisionShapes/btConvexShape.h>

#include "bullet/object_velocity.h"
#include "bullet/shape_parts.h"

namespace smartmesh {

void Slot::read_velocity() {
  const FrameVelocity velocity = velocity_of(*object);
  linear = velocity.linear, angular = velocity.angular;
}

bool Slot::read(BodyState& state) {
  if (object == nullptr) return false;
  read_velocity();
  state = {body_pose(object->getWorldTransform()), linear, angular};
  return true;
}

// A point is moved by at most the way of the middle and by its radius times |R - R'|, whose Frobenius norm is twice the
// root of two times the sine of half the angle between the two.
void Slot::note_still(const Pose& pose, double distance, double duration) {
  double turned = 0.0;
  for (int k = 0; k < 3; ++k) turned += norm2(pose.rotation.row[k] - anchor.rotation.row[k]);
  const double strayed = norm(pose.at - anchor.at) + std::sqrt(0.5 * turned) * rest.radius;
  if (strayed <= distance)
    still += duration;
  else
    anchor = pose, still = 0.0;
}

const Convex* Slot::convex_of_part(const btCollisionShape& shape) {
  const auto [known, is_new] = parts.try_emplace(&shape);
  KnownPart& part = known->second;
  if (is_new || part.margin != shape.getMargin()) {
    part = {shape.getMargin(), convex_of(static_cast<const btConvexShape&>(shape))};
    on_soil.erase(part_number(shape));
  }
  return part.convex ? &*part.convex : nullptr;
}

int Slot::part_number(const btCollisionShape& part) {
  find_leaves();
  return static_cast<int>(std::find(leaves.begin(), leaves.end(), &part) - leaves.begin());
}

void Slot::find_leaves() {
  if (!leaves.empty()) return;
  for_each_part(*object->getCollisionShape(), btTransform::getIdentity(),
                [&](const btCollisionShape& part, const btTransform&) { leaves.push_back(&part); });
}

Vec3 Slot::belt_axis() const {
  const btVector3 axis = object->getWorldTransform().getBasis() * to_bullet(belt.axis);
  return from_bullet(axis.normalized() * belt.speed);
}

void Slot::stir() const {
  if (btMultiBody* robot = robot_of(*object)) robot->wakeUp();
  object->activate();
}

}  // namespace smartmesh
