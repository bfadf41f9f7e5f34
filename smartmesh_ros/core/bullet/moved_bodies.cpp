#include "bullet/moved_bodies.h"

#include <cmath>
#include <map>

#include "ground/deck.h"
#include "step/correction.h"

namespace smartmesh {

namespace {

// Largest horizontal speed on the ground that a body keeps that is put back onto it [m/s].
constexpr double FASTEST_RESCUED = 5.0;
const GroundPoint NO_GROUND{NONE, {}};

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

// Notes which bodies have contacts with the ground.
void note_touching(const Instant& now, Attached& attached) {
  for (Slot& slot : attached.slots) slot.touches = false;
  btDispatcher& dispatcher = *now.world.getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    if (manifold.getNumContacts() == 0) continue;
    Slot* slot = attached.slot_of(*manifold.getBody0());
    if (slot == nullptr) slot = attached.slot_of(*manifold.getBody1());
    if (slot != nullptr) slot->touches = true;
  }
}

// Returns the ground above a point `inside` a part of a PyBullet `body` at the instant of `reader`; height NaN if the
// point is not below the ground, beside the decks that the body carries. The centre of mass of a link is no measure,
// nor is the middle of what bounds it: they may be beside the link's shape, and below the ground without harm.
GroundPoint ground_above(GroundReader& reader, const Vec3& inside, int body) {
  if (!std::isfinite(inside.x + inside.y + inside.z)) return NO_GROUND;
  const GroundPoint ground = reader.near(inside, INFINITE, body);
  return inside.z < ground.height ? ground : NO_GROUND;
}

// Returns the ground above the middles of all parts of a body, NaN if there is none. What has a part above the ground
// is not below it: it may stand astride. In ground that gives a part is above it as long as any point of the body is;
// soil is as deep as it was pressed there.
GroundPoint ground_above_all_parts(const Instant& now, const Slot& it, GroundReader& reader) {
  const Pose pose = from_bullet(it.object->getWorldTransform());
  GroundPoint highest{-INFINITE, {}};
  for (const ShapePart& part : it.body_shape->parts) {
    const Vec3 inside = pose.to_world(part.inside);
    GroundPoint ground = ground_above(reader, inside, it.body);
    if (std::isnan(ground.height)) return ground;
    if (now.soil != nullptr) ground.height -= now.soil->below_map(inside, now.time);
    if (!(inside.z < ground.height)) return NO_GROUND;
    if (ground.height > highest.height) highest = ground;
  }
  const BodyPose at = body_pose(it.object->getWorldTransform());
  const auto gives = [&] {
    return (now.soil != nullptr && now.soil->has(at.at, now.time)) ||
           (now.terrain->has_material() && now.terrain->material(at.at.x, at.at.y, now.time).gives());
  };
  return -it.body_shape->lowest(at, {0.0, 0.0, -1.0}) > highest.height && gives() ? NO_GROUND : highest;
}

// Returns true if PyBullet's groups and masks, or a filter of the pair, keep two objects apart.
bool are_kept_apart(const Instant& now, btCollisionObject& one, btCollisionObject& other) {
  const btOverlapFilterCallback* filter = now.world.getPairCache()->getOverlapFilterCallback();
  return filter != nullptr && !filter->needBroadphaseCollision(one.getBroadphaseHandle(), other.getBroadphaseHandle());
}

// Returns true if an object that may touch a body, but has no mass, is between a point of it and a height below [m].
bool is_over_fixed(const Instant& now, btCollisionObject& body, const Vec3& from, double height) {
  struct Fixed final : btCollisionWorld::ClosestRayResultCallback {
    Fixed(const Instant& at, btCollisionObject& of, const btVector3& from, const btVector3& to)
        : ClosestRayResultCallback(from, to), now(at), body(of) {}
    bool needsCollision(btBroadphaseProxy* proxy) const override {
      auto& object = *static_cast<btCollisionObject*>(proxy->m_clientObject);
      return is_fixed(object) && object.getCollisionShape()->getShapeType() != GROUND_SHAPE_TYPE &&
             !are_kept_apart(now, body, object);
    }
    const Instant& now;
    btCollisionObject& body;
  };
  if (!(height < from.z)) return false;
  Fixed found(now, body, to_bullet(from), btVector3(from.x, from.y, height));
  now.world.rayTest(found.m_rayFromWorld, found.m_rayToWorld, found);
  return found.hasHit();
}

// Lifts a body [m], and gives it the vertical velocity of the `ground` [m/s]. It keeps its slip on that ground.
void lift_body(btCollisionObject& object, double by, const Vec3& ground, btDiscreteDynamicsWorld& world) {
  btMultiBody* robot = robot_of(object);
  btRigidBody* body = btRigidBody::upcast(&object);
  btTransform pose = base_of(object);
  pose.getOrigin().setZ(pose.getOrigin().z() + by);
  btVector3 slide = (robot == nullptr ? body->getLinearVelocity() : robot->getBaseVel()) - to_bullet(ground);
  slide.setZ(0.0);
  if (const double speed = slide.length(); speed > FASTEST_RESCUED) slide *= FASTEST_RESCUED / speed;
  put(object, pose, world);
  if (robot == nullptr)
    body->setLinearVelocity(to_bullet(ground) + slide);
  else
    robot->setBaseVel(to_bullet(ground) + slide);
}

// Moves bodies with corrections of maps of some tiles, in the frame of a deck if they are of one.
void move_with_corrections_of(Tiles& tiles, const Deck* deck, const Instant& now, Attached& attached) {
  std::vector<MapCorrection> corrections;
  tiles.show_corrections(now.time, corrections);
  if (corrections.empty()) return;
  const btTransform frame = deck != nullptr ? to_bullet(deck->motion.at(now.time).pose) : btTransform::getIdentity();
  note_touching(now, attached);
  GroundReader reader = now.terrain->reader(now.time, INSTANT);
  for (const AttachedBody& body : attached.bodies) {
    btCollisionObject* object = nullptr;
    BodyPose pose;
    CorrectionSums sums;
    for (int k : body.slots) {
      const Slot& slot = attached.slots[k];
      if (!slot.kind.is_solid || slot.rest.asleep || slot.object == nullptr) continue;
      if (!is_borne_by(deck, slot, reader, now, attached)) continue;
      const BodyPose here = body_pose(frame.inverseTimes(slot.object->getWorldTransform()));
      if (object == nullptr) object = slot.object, pose = body_pose(frame.inverseTimes(base_of(*object)));
      for (const auto& [map, shown] : corrections) {
        HeightGrid before = *map;
        before.shown = shown;
        add_points_under(before, *map, now.time, *slot.body_shape, here, slot.touches, pose.at, sums);
      }
    }
    if (object == nullptr || is_fixed(*object) || !move_with(sums, pose)) continue;
    const Quaternion& q = pose.orientation;
    put(*object, frame * btTransform(btQuaternion(q.x, q.y, q.z, q.w), to_bullet(pose.at)), now.world);
  }
}

}  // namespace

bool is_borne_by(const Deck* ground, const Slot& slot, GroundReader& reader, const Instant& now, Attached& attached) {
  const std::size_t most = reader.decks == nullptr ? 0 : reader.decks->size();
  const Slot* it = &slot;
  for (std::size_t carriers = 0; carriers <= most && it != nullptr && !is_fixed(*it->object); ++carriers) {
    const Solid solid(it->body_shape->outline, body_pose(it->object->getWorldTransform()));
    const NearPoint near = reader.near(solid.centre, INFINITE, it->body);
    if (!it->touches && is_over_fixed(now, *it->object, solid.centre, near.height)) return false;
    if (near.deck == ground || near.deck == nullptr) return near.deck == ground && !near.on_mesh;
    it = attached.has_body(near.deck->body) ? attached.moving_slot(attached.bodies[near.deck->body]) : nullptr;
  }
  return false;
}

void move_with_corrections(const Instant& now, Attached& attached) {
  move_with_corrections_of(*now.terrain, nullptr, now, attached);
  for (Deck* deck : now.terrain->decks()) move_with_corrections_of(deck->tiles, deck, now, attached);
}

std::vector<int> find_below(const Instant& now, Attached& attached) {
  attached.find_objects();
  GroundReader reader = now.terrain->reader(now.time, INSTANT);
  return attached.where([&](const Slot& slot) {
    return slot.kind.is_own && slot.object != nullptr && !std::isnan(ground_above_all_parts(now, slot, reader).height);
  });
}

std::vector<int> lift_bodies(const Instant& now, Attached& attached, const std::vector<int>& slots) {
  if (slots.empty()) return {};
  struct Lift {
    double by;
    Vec3 ground;
  };
  std::map<int, Lift> lifts;  // robots as a whole, by the largest lift of their links
  GroundReader reader = now.terrain->reader(now.time, INSTANT);
  for (int k : slots) {
    const Slot& slot = attached.slots[k];
    if (slot.object == nullptr) continue;
    if (slot.ground != nullptr && are_kept_apart(now, *slot.object, *slot.ground)) continue;
    const GroundPoint ground = ground_above_all_parts(now, slot, reader);
    if (std::isnan(ground.height)) continue;
    const BodyPose pose = body_pose(slot.object->getWorldTransform());
    const Lift lift{ground.height - slot.body_shape->lowest(pose), ground.velocity};
    const auto [known, is_new] = lifts.try_emplace(slot.body, lift);
    if (!is_new && lift.by > known->second.by) known->second = lift;
  }
  std::vector<int> lifted;
  for (const auto& [body, lift] : lifts) {
    const Slot* slot = attached.moving_slot(attached.bodies[body]);
    if (slot == nullptr || is_fixed(*slot->object)) continue;
    lift_body(*slot->object, lift.by, lift.ground, now.world);
    lifted.push_back(body);
  }
  return lifted;
}

}  // namespace smartmesh
