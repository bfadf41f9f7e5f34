// A step of the ground in a Bullet world: proxies are placed, contacts are found, soil is pressed.
#include "world.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "contact_points.h"

namespace smartmesh {

namespace {

// Distance below a body at which its proxy waits while the ground is far [m]. Above the margin of Bullet's broadphase.
constexpr double APART = 1.0;

// Returns the mass of a rigid body, or of a robot with all its links [kg].
double mass_of(const btCollisionObject& object) {
  if (const auto* rigid = btRigidBody::upcast(&object)) return 1.0 / rigid->getInvMass();
  const btMultiBody& body = *btMultiBodyLinkCollider::upcast(&object)->m_multiBody;
  double mass = body.getBaseMass();
  for (int link = 0; link < body.getNumLinks(); ++link) mass += body.getLink(link).m_mass;
  return mass;
}

}  // namespace

void BulletWorld::before_step() {
  if (world_ == nullptr) return;
  find_objects();
  for (Slot& slot : slots_)
    if (slot.used && slot.ground != nullptr) place(slot);
}

void BulletWorld::after_step() {
  if (world_ == nullptr) return;
  duration = world_->getDispatchInfo().m_timeStep;
  time += duration;
  press_soil();
  if (std::none_of(slots_.begin(), slots_.end(), [](const Slot& slot) { return slot.belt.speed != 0.0; })) return;
  btDispatcher& dispatcher = *world_->getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    const bool ground_is_b = is_driven(*manifold.getBody1());
    if (ground_is_b || is_driven(*manifold.getBody0())) put_back_places(manifold, ground_is_b);
  }
}

void BulletWorld::press_soil() {
  if (soil == nullptr) return;
  for (Slot& slot : slots_) {
    if (slot.on_soil.empty() || slot.object == nullptr || slot.ground == nullptr) continue;
    if (!slot.enabled || !slot.object->isActive()) continue;
    read_velocity(slot);
    soil->press(on_soil(slot, duration), slot.on_soil);
  }
  soil->next();
}

// A robot rests on those of its links alike that touched the soil in the last step.
OnSoil BulletWorld::on_soil(const Slot& slot, double step) const {
  int count = 0;
  for (const Slot& other : slots_) {
    if (!other.used || other.body != slot.body) continue;
    for (const auto& [shape, part] : other.on_soil) count += soil->was_near(part) && !part.up.empty();
  }
  OnSoil found{};
  found.pose = from_bullet(slot.object->getWorldTransform());
  found.centre = found.pose.at;
  found.linear = slot.linear - from_bullet(slot.ground->getLinearVelocity());
  found.angular = slot.angular;
  if (slot.belt.speed != 0.0) found.belt = belt_of(slot), found.anchor_time = anchor_time(step);
  found.mass = mass_of(*slot.object) / std::max(count, 1);
  found.gravity = world_->getGravity().length();
  found.duration = step, found.time = time;
  found.rise = soil->rise_at(found.centre, time);
  return found;
}

bool BulletWorld::is_driven(const btCollisionObject& ground) const {
  const auto found = slot_of_ground_.find(ground.getCollisionShape());
  return found != slot_of_ground_.end() && slots_[found->second].belt.speed != 0.0;
}

void BulletWorld::place(Slot& slot) {
  btRigidBody& ground = *slot.ground;
  ground.setLinearVelocity(btVector3(0, 0, 0));
  ground.setAngularVelocity(btVector3(0, 0, 0));
  slot.shape->low = slot.shape->high = btVector3(0, 0, 0);
  ground.forceActivationState(ISLAND_SLEEPING);  // Bullet wakes whatever lies on a kinematic body that is awake
  if (slot.object == nullptr || !slot.enabled) return;
  if (slot.belt.speed != 0.0) wake(slot);  // PyBullet would let it sleep while it creeps
  const btTransform& pose = slot.object->getWorldTransform();
  btVector3 low, high;
  slot.object->getCollisionShape()->getAabb(pose, low, high);
  if (keeps_asleep(slot, low, high)) return;
  read_velocity(slot);
  const double half = 0.5 * std::max(high.x() - low.x(), high.y() - low.y());
  const Vec3 at = from_bullet(pose.getOrigin());
  if (!std::isfinite(at.x + at.y + at.z + norm2(slot.linear) + norm2(slot.angular))) return;
  const double size = norm(from_bullet(high - low)), turn = std::min(1.0, norm(slot.angular) * duration);
  GroundMotion motion;
  if (carry_velocity && duration > 0.0) motion = surface.motion_at(at.x, at.y, half, time, duration, high.z());
  const double moved = norm(motion.linear) * duration;
  const double grown = margin_in(duration) + turn * size + moved;
  const btVector3 by(grown, grown, grown), travel = to_bullet(slot.linear * duration);
  low.setMin(low + travel), high.setMax(high + travel);
  low -= by, high += by;
  if (surface.highest_under({from_bullet(low), from_bullet(high)}, time) < low.z())
    high = low -= btVector3(0, 0, APART);  // so that they are no pair
  // Bullet itself renews the bounds of awake objects only.
  world_->getBroadphase()->setAabb(ground.getBroadphaseHandle(), low, high, world_->getDispatcher());
  if (low == high) return;
  btTransform foot;
  foot.setIdentity();
  foot.setOrigin(motion.known ? to_bullet(motion.foot) : pose.getOrigin());
  slot.shape->low = low - foot.getOrigin();
  slot.shape->high = high - foot.getOrigin();
  slot.shape->origin = foot.getOrigin();
  ground.setWorldTransform(foot);
  ground.setInterpolationWorldTransform(foot);
  ground.setLinearVelocity(to_bullet(motion.linear));
  ground.setAngularVelocity(to_bullet(motion.angular));
  if (moved > 0.0 || norm2(motion.angular) > 0.0) wake(slot);
}

// Returns true if PyBullet put a body to sleep and the ground under it is what it fell asleep on; wakes it otherwise.
bool BulletWorld::keeps_asleep(Slot& slot, const btVector3& low, const btVector3& high) {
  if (slot.object->isActive()) {
    slot.slept_on.clear();
    slot.slept_at = -1;
    return false;
  }
  if (slot.held) return true;
  const bool moves = surface.moves(time);
  if (!moves && slot.slept_at == surface.revision()) return true;
  slot.slept_at = surface.revision();
  std::vector<double> ground;
  surface.ground_under({from_bullet(low), from_bullet(high)}, time, ground);
  const bool same = slot.slept_on.empty() || slot.slept_on == ground;
  if (slot.slept_on.empty()) slot.slept_on = ground;
  if (same) return true;
  wake(slot);
  return false;
}

void BulletWorld::wake(const Slot& slot) {
  if (auto* collider = btMultiBodyLinkCollider::upcast(slot.object)) collider->m_multiBody->wakeUp();
  slot.object->activate();
}

const Convex* BulletWorld::convex_of_part(Slot& slot, const btCollisionShape& shape) {
  const auto [known, is_new] = slot.shapes.try_emplace(&shape);
  if (is_new) known->second = convex_of(static_cast<const btConvexShape&>(shape));
  return known->second ? &*known->second : nullptr;
}

void BulletWorld::touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
                        btPersistentManifold& manifold, double step) {
  const auto found = slot_of_ground_.find(ground.getCollisionShape());
  if (found == slot_of_ground_.end()) {
    manifold.setNumContacts(0);
    return;
  }
  Slot& slot = slots_[found->second];
  if (slot.object != body.getCollisionObject() || !slot.enabled) {
    manifold.setNumContacts(0);
    return;
  }
  const Convex* shape = convex_of_part(slot, *body.getCollisionShape());
  if (shape == nullptr) return;
  Pose pose = from_bullet(body.getWorldTransform());
  for (Vec3& row : pose.turn.row) row = rotated(shape->turn.inverse(), row);
  if (soil != nullptr && soil->is_under(pose.at, time)) {
    soil->touch(body, ground, *shape, pose, on_soil(slot, step), world_->getSolverInfo().m_linearSlop,
                slot.on_soil[body.getCollisionShape()], manifold);
    return;
  }
  Approach approach = approach_of(slot);
  approach.duration = step;
  approach.gravity = from_bullet(world_->getGravity());
  approach.margin = margin_in(step);
  search_.run(*shape, pose, surface, time, approach, contacts_);
  read_contacts(manifold, before_);
  choose_contacts(*shape, pose, approach, before_, contacts_);
  if (surface.has_friction()) {
    const SurfaceReader ground_now = surface.reader(time, INSTANT);
    for (Contact& contact : contacts_) contact.friction = ground_now.tiles.friction(contact.point.x, contact.point.y);
  }
  Touching touching{body, ground, approach, world_->getSolverInfo().m_erp2};
  if (slot.belt.speed != 0.0) {
    touching.belt = belt_of(slot), touching.anchor_time = anchor_time(step);
    // Rigid contacts may share a load in any way. These share it as equal springs, 0.1 mm deep at 240 Hz.
    touching.softness = step / mass_of(*slot.object);
  }
  write_contacts(contacts_, before_, touching, manifold);
}

Vec3 BulletWorld::belt_of(const Slot& slot) const {
  const btVector3 axis = slot.object->getWorldTransform().getBasis() * to_bullet(slot.belt.axis);
  return from_bullet(axis.normalized() * slot.belt.speed);
}

double BulletWorld::anchor_time(double step) const {
  const double share = world_->getSolverInfo().m_frictionERP;  // of a distance, closed in a step
  return share > 0.0 ? step / share : 0.0;
}

double BulletWorld::margin_in(double step) const { return margin + world_->getGravity().length() * step * step; }

Approach BulletWorld::approach_of(const Slot& slot) const {
  const btRigidBody& proxy = *slot.ground;
  const btVector3 centre = slot.object->getWorldTransform().getOrigin();
  Approach approach;
  approach.centre = from_bullet(centre);
  approach.angular = slot.angular - from_bullet(proxy.getAngularVelocity());
  approach.linear =
      slot.linear - from_bullet(proxy.getVelocityInLocalPoint(centre - proxy.getWorldTransform().getOrigin()));
  return approach;
}

}  // namespace smartmesh
