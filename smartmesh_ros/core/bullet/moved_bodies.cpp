// Bodies that are moved without physics: with corrections of the ground, or back onto it.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/world.h"
#include "step/below_ground.h"
#include "step/correction.h"

namespace smartmesh {

namespace {

// Largest horizontal speed on the ground that a body keeps that is put back onto it [m/s].
constexpr double FASTEST_RESCUED = 5.0;

// Returns true if the base of a body has no mass, so that physics does not move it.
bool is_fixed(btCollisionObject& object) {
  if (const btMultiBody* robot = robot_of(object)) return robot->hasFixedBase() || robot->getBaseMass() == 0.0;
  const auto* body = btRigidBody::upcast(&object);
  return body == nullptr || body->getInvMass() == 0.0;
}

// Returns where a rigid body is, or the base of a robot.
btTransform base_of(btCollisionObject& object) {
  const btMultiBody* robot = robot_of(object);
  return robot == nullptr ? object.getWorldTransform()
                          : btTransform(robot->getWorldToBaseRot().inverse(), robot->getBasePos());
}

// Renews what Bullet knows of the bounds of an object that was at a pose `before`.
void renew_bounds(const btCollisionObject& object, const btTransform& before, btDiscreteDynamicsWorld& world) {
  btBroadphaseProxy* bounds = const_cast<btBroadphaseProxy*>(object.getBroadphaseHandle());
  if (bounds == nullptr) return;
  btVector3 old_low, old_high, low, high;
  object.getCollisionShape()->getAabb(before, old_low, old_high);
  object.getCollisionShape()->getAabb(object.getWorldTransform(), low, high);
  world.getBroadphase()->setAabb(bounds, bounds->m_aabbMin + low - old_low, bounds->m_aabbMax + high - old_high,
                                 world.getDispatcher());
}

// Moves a robot with all its links to where its base is at a pose.
void put_robot(btMultiBody& robot, const btTransform& pose, btDiscreteDynamicsWorld& world) {
  std::vector<std::pair<btCollisionObject*, btTransform>> before;
  for (int link = -1; link < robot.getNumLinks(); ++link) {
    btCollisionObject* each = link < 0 ? robot.getBaseCollider() : robot.getLinkCollider(link);
    if (each != nullptr) before.emplace_back(each, each->getWorldTransform());
  }
  robot.setBasePos(pose.getOrigin());
  robot.setWorldToBaseRot(pose.getRotation().inverse());
  btAlignedObjectArray<btQuaternion> rotations;
  btAlignedObjectArray<btVector3> origins;
  robot.forwardKinematics(rotations, origins);
  robot.updateCollisionObjectWorldTransforms(rotations, origins);
  for (const auto& [each, pose_before] : before) renew_bounds(*each, pose_before, world);
}

// Moves a body to where it is, or the base of a robot, at a pose; velocities stay.
void put(btCollisionObject& object, const btTransform& pose, btDiscreteDynamicsWorld& world) {
  if (btMultiBody* robot = robot_of(object)) return put_robot(*robot, pose, world);
  const btTransform before = object.getWorldTransform();
  btRigidBody::upcast(&object)->setCenterOfMassTransform(pose);
  renew_bounds(object, before, world);
}

btVector3 velocity_of_base(btCollisionObject& object) {
  const btMultiBody* robot = robot_of(object);
  return robot == nullptr ? btRigidBody::upcast(&object)->getLinearVelocity() : robot->getBaseVel();
}

void set_velocity_of_base(btCollisionObject& object, const btVector3& velocity) {
  if (btMultiBody* robot = robot_of(object)) return robot->setBaseVel(velocity);
  btRigidBody::upcast(&object)->setLinearVelocity(velocity);
}

}  // namespace

std::vector<bool> BulletWorld::find_touching() {
  std::vector<bool> found(slots_.size(), false);
  btDispatcher& dispatcher = *world_->getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    if (manifold.getNumContacts() == 0) continue;
    const Slot* slot = slot_of(*manifold.getBody0());
    if (slot == nullptr) slot = slot_of(*manifold.getBody1());
    if (slot != nullptr) found[slot - slots_.data()] = true;
  }
  return found;
}

// A body that lay on the ground lies on it again, at the same velocity. A robot moves as a whole, by the ground under
// the links that touch it.
void BulletWorld::move_with_corrections() {
  corrections_.clear();
  terrain->show_corrections(time, corrections_);
  if (corrections_.empty()) return;
  const std::vector<bool> stands = find_touching();
  for (const OfBody& body : bodies_) {
    btCollisionObject* object = nullptr;
    BodyPose pose;
    CorrectionSums sums;
    for (const Role& role : body.roles) {
      const Slot& slot = slots_[role.slot];
      if (role.is_proxy || !slot.kind.is_solid || slot.rest.asleep || slot.object == nullptr) continue;
      if (object == nullptr) object = slot.object, pose = body_pose(base_of(*object));
      const BodyPose now = body_pose(slot.object->getWorldTransform());
      for (const auto& [map, shown] : corrections_) {
        HeightGrid before = *map;
        before.shown = shown;
        add_points_under(before, *map, time, *slot.body_shape, now, stands[role.slot], pose.at, sums);
      }
    }
    if (object == nullptr || is_fixed(*object) || !move_with(sums, pose)) continue;
    const Quaternion& q = pose.orientation;
    put(*object, btTransform(btQuaternion(q.x, q.y, q.z, q.w), to_bullet(pose.at)), *world_);
  }
}

// What has a part above the ground is not below it: it may stand astride. In ground that gives a part is above it as
// long as any point of the body is.
GroundPoint BulletWorld::ground_above_all_parts(int slot, GroundReader& reader) const {
  const Slot& it = slots_[slot];
  const Pose pose = from_bullet(it.object->getWorldTransform());
  GroundPoint highest{-std::numeric_limits<double>::infinity(), {}};
  for (const ShapePart& part : it.body_shape->parts) {
    const GroundPoint ground = ground_above(reader, pose.to_world(part.inside), it.body);
    if (std::isnan(ground.height)) return ground;
    if (ground.height > highest.height) highest = ground;
  }
  const BodyPose at = body_pose(it.object->getWorldTransform());
  if (terrain->has_material() && -it.body_shape->lowest(at, {0.0, 0.0, -1.0}) > highest.height &&
      terrain->material(at.at.x, at.at.y, time).gives())
    return {std::numeric_limits<double>::quiet_NaN(), {}};
  return highest;
}

std::vector<int> BulletWorld::find_below() {
  find_objects();
  GroundReader reader = terrain->reader(time, INSTANT);
  std::vector<int> found;
  for (int k = 0; k < static_cast<int>(slots_.size()); ++k) {
    if (!slots_[k].kind.is_own || slots_[k].object == nullptr) continue;
    if (!std::isnan(ground_above_all_parts(k, reader).height)) found.push_back(k);
  }
  return found;
}

std::vector<int> BulletWorld::find_nowhere(double farthest) const {
  std::vector<int> found;
  for (std::size_t k = 0; k < slots_.size(); ++k) {
    if (slots_[k].object == nullptr || slots_[k].rest.asleep) continue;
    const btVector3 away = slots_[k].object->getWorldTransform().getOrigin().absolute();
    if (!(away.x() <= farthest && away.y() <= farthest && away.z() <= farthest)) found.push_back(static_cast<int>(k));
  }
  return found;
}

// Returns true if PyBullet's groups and masks, or a filter of the pair, keep a body and its ground apart.
bool BulletWorld::is_kept_from_ground(const Slot& slot) const {
  const btOverlapFilterCallback* filter = world_->getPairCache()->getOverlapFilterCallback();
  return filter != nullptr && slot.ground != nullptr &&
         !filter->needBroadphaseCollision(slot.object->getBroadphaseHandle(), slot.ground->getBroadphaseHandle());
}

// Bodies that were spawned or teleported below the ground, covered by a map, or pushed there by another body.
void BulletWorld::lift_bodies() {
  if (maybe_below_.empty()) return;
  struct Lift {
    double by;
    Vec3 ground;
  };
  std::map<int, Lift> lifts;  // robots as a whole, by the largest lift of their links
  GroundReader reader = terrain->reader(time, INSTANT);
  for (int k : maybe_below_) {
    if (slots_[k].object == nullptr || is_kept_from_ground(slots_[k])) continue;
    const GroundPoint ground = ground_above_all_parts(k, reader);
    if (std::isnan(ground.height)) continue;
    const BodyPose pose = body_pose(slots_[k].object->getWorldTransform());
    const Lift lift{ground.height - slots_[k].body_shape->lowest(pose), ground.velocity};
    const auto [known, is_new] = lifts.try_emplace(slots_[k].body, lift);
    if (!is_new && lift.by > known->second.by) known->second = lift;
  }
  for (const auto& [body, lift] : lifts) lift_body(body, lift.by, lift.ground);
}

// Lifts a body [m], and gives it the vertical velocity of the `ground` [m/s].
void BulletWorld::lift_body(int body, double by, const Vec3& ground) {
  const Slot* slot = moving_slot(bodies_[body]);
  if (slot == nullptr || is_fixed(*slot->object)) return;
  btCollisionObject& object = *slot->object;
  btTransform pose = base_of(object);
  pose.getOrigin().setZ(pose.getOrigin().z() + by);
  btVector3 slide = velocity_of_base(object) - to_bullet(ground);
  slide.setZ(0.0);
  if (const double speed = slide.length(); speed > FASTEST_RESCUED) slide *= FASTEST_RESCUED / speed;
  put(object, pose, *world_);
  set_velocity_of_base(object, to_bullet(ground) + slide);
  ++rescues_;
  wake_body(body);
  for (const Role& role : bodies_[body].roles)
    if (!role.is_proxy && slots_[role.slot].ground != nullptr) place(slots_[role.slot]);
}

}  // namespace smartmesh
