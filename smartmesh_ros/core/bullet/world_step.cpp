// A step of the ground in a Bullet world: proxies are placed, contacts are found, soil is pressed.
#include "bullet/world.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/broadphase.h"
#include "bullet/contact_points.h"
#include "bullet/shape_parts.h"
#include "contact/foundation.h"
#include "step/step_lock.h"

namespace smartmesh {

namespace {

// Bounds of a proxy are larger than the reach of its body by this share of their diagonal, so that Bullet needs to
// renew them, and the pairs in them, once in several steps. Larger bounds have more pairs without contacts.
constexpr double SLACK = 0.1;

// Returns the mass of a rigid body, or of a robot with all its links [kg].
double mass_of(const btCollisionObject& object) {
  if (const auto* rigid = btRigidBody::upcast(&object)) return 1.0 / rigid->getInvMass();
  const btMultiBody& body = *btMultiBodyLinkCollider::upcast(&object)->m_multiBody;
  double mass = body.getBaseMass();
  for (int link = 0; link < body.getNumLinks(); ++link) mass += body.getLink(link).m_mass;
  return mass;
}

// Puts bounds around the reach of a proxy's body, if those of the step before do not serve; null = it reaches nothing.
// Bullet itself renews the bounds of awake objects only.
void bound(btDiscreteDynamicsWorld& world, btRigidBody& ground, const Bounds* reach) {
  btBroadphaseProxy& bounds = *ground.getBroadphaseHandle();
  Bounds wanted{{0.0, 0.0, FAR_BELOW}, {0.0, 0.0, FAR_BELOW}};
  if (reach != nullptr) {
    const Bounds now{from_bullet(bounds.m_aabbMin), from_bullet(bounds.m_aabbMax)};
    const double slack = SLACK * norm(reach->high - reach->low);
    if (now.contains(*reach) && reach->grown(2.0 * slack).contains(now)) return;
    wanted = reach->grown(slack);
  }
  world.getBroadphase()->setAabb(&bounds, to_bullet(wanted.low), to_bullet(wanted.high), world.getDispatcher());
}

// Returns the pose of a shape that is turned in Bullet's frame of it.
Pose pose_of(const Convex& shape, const btTransform& at) {
  Pose pose = from_bullet(at);
  for (Vec3& row : pose.rotation.row) row = rotated(shape.orientation.inverse(), row);
  return pose;
}

}  // namespace

void BulletWorld::before_step() {
  if (world_ == nullptr) return;
  stepping_ = true;
  told_.clear();
  update();
}

void BulletWorld::update() {
  find_objects();
  move_with_corrections();
  place_proxies();
  lift_bodies();
}

void BulletWorld::before_query() {
  const StepLock lock;
  guarded([&] {
    if (world_ != nullptr && !stepping_) place_proxies();
  });
}

void BulletWorld::place_proxies() {
  find_objects();
  if (!terrain->decks().empty()) move_carried();
  wake_disturbed();
  list_slots();
  maybe_below_.clear();
  for (int k : awake_) {
    if (slots_[k].ground != nullptr)
      guarded([&] { place(slots_[k]); });
    else if (slots_[k].kind.is_own)
      maybe_below_.push_back(k);
  }
}

void BulletWorld::after_step() {
  stepping_ = false;
  if (world_ == nullptr) return;
  duration = world_->getDispatchInfo().m_timeStep;
  time += duration;
  terrain->note_shown(time);
  press_soil();
  if (!terrain->decks().empty()) react();
  for (const TruePoint& point : told_) restore(point);
  told_.clear();
  note_rest();
}

void BulletWorld::press_soil() {
  if (soil == nullptr) return;
  for (Slot& slot : slots_) {
    if (slot.on_soil.empty() || slot.object == nullptr || slot.ground == nullptr) continue;
    if (!slot.object->isActive()) continue;
    read_velocity(slot);
    soil->press(on_soil(slot, duration, -duration), slot.on_soil);
  }
  soil->next();
}

// A robot rests on those of its links alike that touched the soil in the last step.
OnSoil BulletWorld::on_soil(const Slot& slot, double step, double ahead) const {
  int count = 0;
  for (const Role& role : bodies_[slot.body].roles) {
    if (role.is_proxy) continue;
    for (const auto& [number, part] : slots_[role.slot].on_soil) count += soil->was_near(part) && !part.up.empty();
  }
  OnSoil found;
  found.pose = from_bullet(slot.object->getWorldTransform());
  found.soil = soil->motion_around(found.pose.at, slot.rest.radius, time, ahead);
  found.approach.centre = found.pose.at;
  found.approach.linear = slot.linear - found.soil.velocity_at(found.pose.at);
  found.approach.angular = slot.angular - found.soil.angular;
  found.approach.duration = step;
  found.approach.gravity = from_bullet(world_->getGravity());
  if (slot.belt.speed != 0.0) found.belt = belt_of(slot);
  found.mass = mass_of(*slot.object) / std::max(count, 1);
  found.time = time;
  return found;
}

void BulletWorld::place(Slot& slot) {
  btRigidBody& ground = *slot.ground;
  ground.setLinearVelocity(btVector3(0, 0, 0));
  ground.setAngularVelocity(btVector3(0, 0, 0));
  slot.shape->low = slot.shape->high = btVector3(0, 0, 0);
  ground.forceActivationState(ISLAND_SLEEPING);  // Bullet wakes whatever lies on a kinematic body that is awake
  if (slot.object == nullptr) return;
  if (slot.belt.speed != 0.0) stir(slot);  // PyBullet would let it sleep while it creeps
  const btTransform& pose = slot.object->getWorldTransform();
  btVector3 low, high;
  slot.object->getCollisionShape()->getAabb(pose, low, high);
  read_velocity(slot);
  const Vec3 at = from_bullet(pose.getOrigin());
  if (!std::isfinite(at.x + at.y + at.z + norm2(slot.linear) + norm2(slot.angular))) return;
  const double size = norm(from_bullet(high - low)), angle = std::min(1.0, norm(slot.angular) * duration);
  const Bounds bounds = Bounds{from_bullet(low), from_bullet(high)}.grown(margin_in(duration) + angle * size);
  const Bounds swept = bounds.swept(slot.linear * duration);
  const NearbyGround& near = slot.near = terrain->near(swept, time, duration);
  if (slot.kind.is_own) {
    const bool has_decks = !terrain->decks().empty();  // which are ground above bodies that are far below
    if (has_decks || near.highest > (pose * to_bullet(slot.body_shape->parts[0].inside)).z())
      maybe_below_.push_back(static_cast<int>(&slot - slots_.data()));
  }
  const double by_decks = terrain->decks().empty() ? -1.0 : find_decks(slot, bounds);
  const double moved = std::max((norm(near.velocity) + near.spread) * duration, by_decks);
  const Bounds reach = swept.grown(moved);
  const bool is_above = near.highest < reach.low.z, is_far = is_above && by_decks < 0.0;
  bound(*world_, ground, is_far ? nullptr : &reach);
  if (is_far) return;
  low = to_bullet(reach.low), high = to_bullet(reach.high);
  const btTransform frame(btQuaternion::getIdentity(), pose.getOrigin());
  slot.shape->low = low - frame.getOrigin();
  slot.shape->high = high - frame.getOrigin();
  slot.shape->origin = frame.getOrigin();
  ground.setWorldTransform(frame);
  ground.setInterpolationWorldTransform(frame);
  // What the solver does beside the rows of contacts, as pushing deep bodies out, is relative to the proxy.
  const Vec3 turned = cross(slot.ground_angular, at - (swept.low + swept.high) * 0.5);
  ground.setLinearVelocity(to_bullet(is_above ? slot.decks.front().velocity : near.velocity + turned));
  ground.setAngularVelocity(to_bullet(slot.ground_angular));
  // Bullet's solver has a copy of each kinematic body, and one for all that are static.
  const bool rests = ground.getLinearVelocity().isZero() && ground.getAngularVelocity().isZero();
  constexpr int STATIC = btCollisionObject::CF_STATIC_OBJECT, KINEMATIC = btCollisionObject::CF_KINEMATIC_OBJECT;
  ground.setCollisionFlags((ground.getCollisionFlags() & ~(STATIC | KINEMATIC)) | (rests ? STATIC : KINEMATIC));
  if (moved > 0.0) stir(slot);
}

const Convex* BulletWorld::convex_of_part(Slot& slot, const btCollisionShape& shape) {
  const auto [known, is_new] = slot.parts.try_emplace(&shape);
  KnownPart& part = known->second;
  if (is_new || part.margin != shape.getMargin()) {
    part = {shape.getMargin(), convex_of(static_cast<const btConvexShape&>(shape))};
    slot.on_soil.erase(part_number(slot, shape));
  }
  return part.convex ? &*part.convex : nullptr;
}

void BulletWorld::touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
                        btPersistentManifold& manifold, double step) {
  Slot& slot = *slot_of(*ground.getCollisionObject());
  const Convex* shape = convex_of_part(slot, *body.getCollisionShape());
  if (shape == nullptr) return;
  const Pose pose = pose_of(*shape, body.getWorldTransform());
  read_contacts(manifold, before_);
  const Approach approach = approach_of(slot, step);
  const btContactSolverInfo& solver = world_->getSolverInfo();
  const auto* rigid = btRigidBody::upcast(slot.object);
  const Vec3 pull = rigid != nullptr ? from_bullet(rigid->getTotalForce() * (rigid->getInvMass() * step))
                                     : from_bullet(world_->getGravity() * step);
  on_decks_.clear(), seams_.clear();
  if (!slot.decks.empty()) find_deck_contacts(slot, *shape, pose, step);
  if (on_decks_.empty() && soil != nullptr && soil->is_under(pose.at, time)) {
    SoilPart& part = slot.on_soil[part_number(slot, *body.getCollisionShape())];
    soil->touch(*shape, pose, on_soil(slot, step, step), before_, part, contacts_, rows_);
  } else {
    search_.run(*shape, pose, *terrain, time, approach.with_margin(slot.near.spread * step), contacts_);
    contacts_.insert(contacts_.end(), on_decks_.begin(), on_decks_.end());
    seams_.remove_hidden(search_, pose.to_world(shape->centre), contacts_);
    choose_contacts(*shape, pose, approach, before_, contacts_);
    if (!on_decks_.empty()) let_decks_yield();
    const bool has_material = terrain->has_material();
    if (has_material)
      for (Contact& contact : contacts_)
        if (contact.deck < 0) contact.material = terrain->material(contact.point.x, contact.point.y, time);
    BodySurface own;
    read_surface(*slot.object, *slot.ground, own);
    if (slot.belt.speed != 0.0) own.belt = belt_of(slot), own.mass = mass_of(*slot.object);
    find_rows(contacts_, approach, own, {solver.m_erp2, solver.m_linearSlop, solver.m_restitutionVelocityThreshold},
              rows_);
    place_in_mid_step(*shape, pose, contacts_, approach, rows_);
    if (has_material) {
      lay_on_foundation(*shape, pose, approach, own, contacts_, rows_);
      resist_rolling(contacts_, approach, pull, rows_);
    }
  }
  // Friction against rolling, and that of robots if PyBullet's `frictionERP` is zero, aim at the proxy's velocity.
  const bool turns =
      !rows_.empty() && (rows_[0].friction.rolling + rows_[0].friction.spinning > 0.0 || anchor_time(step) == 0.0);
  slot.ground_angular = turns ? contacts_[0].ground.angular : Vec3{};
  if (rigid != nullptr) {  // robots have a solver with a cone of its own
    // Bullet's anisotropic friction acts against velocities alone.
    static const std::vector<OldContact> NONE;
    const auto& before = slot.object->hasAnisotropicFriction() ? NONE : before_;
    find_slips(contacts_, before, approach, {pull, slot.pull, mass_of(*slot.object)}, rows_);
    slot.pull = pull;
  }
  const bool ground_is_b = manifold.getBody0() == slot.object;
  write_contacts(contacts_, rows_, before_,
                 {*slot.object, *slot.ground, ground_is_b, step, solver.m_linearSlop, anchor_time(step)}, manifold,
                 told_);
}

std::optional<Contact> BulletWorld::deepest_contact(int index) {
  find_objects();
  Slot& slot = slots_[index];
  std::optional<Contact> deepest;
  if (slot.object == nullptr) return deepest;
  const auto look = [&](const btCollisionShape& part, const btTransform& at) {
    const Convex* shape = part.isConvex() ? convex_of_part(slot, part) : nullptr;
    if (shape == nullptr) return;
    Approach still;
    still.centre = from_bullet(at.getOrigin());
    const Pose pose = pose_of(*shape, at);
    search_.run(*shape, pose, *terrain, time, still, contacts_);
    seams_.clear();
    const auto& decks = terrain->decks();
    for (std::size_t k = 0; k < decks.size(); ++k)
      if (decks[k]->body != slot.body)
        deck_search_.add(*shape, pose, *decks[k], {static_cast<int>(k), {}, 0.0}, time, still, contacts_, seams_);
    seams_.remove_hidden(search_, pose.to_world(shape->centre), contacts_);
    for (const Contact& contact : contacts_)
      if (contact.distance <= 0.0 && (!deepest || contact.distance < deepest->distance)) deepest = contact;
  };
  for_each_part(*slot.object->getCollisionShape(), slot.object->getWorldTransform(), look);
  return deepest;
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

Approach BulletWorld::approach_of(const Slot& slot, double step) const {
  Approach approach;
  approach.centre = from_bullet(slot.object->getWorldTransform().getOrigin());
  approach.angular = slot.angular;
  approach.linear = slot.linear - slot.near.velocity;
  approach.duration = step;
  approach.margin = margin_in(step);
  approach.gravity = from_bullet(world_->getGravity());
  approach.ground = slot.near.velocity;
  approach.ahead = step;
  return approach;
}

}  // namespace smartmesh
