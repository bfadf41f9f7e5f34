// A step of the ground in a Bullet world: proxies are placed, and bodies that are below the ground are lifted.
#include <algorithm>
#include <cmath>

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/moved_bodies.h"
#include "bullet/world.h"
#include "step/step_lock.h"

namespace smartmesh {

namespace {

// Bounds of a proxy are larger than the reach of its body by this share of their diagonal, so that Bullet needs to
// renew them, and the pairs in them, once in several steps. Larger bounds have more pairs without contacts.
constexpr double SLACK = 0.1;

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

}  // namespace

void BulletWorld::before_step() {
  now.stepping = true;
  narrowphase.told.clear();
  update();
  for (int k : attached.awake) attached.slots[k].ground_angular = {};  // contacts of all parts say it anew
}

void BulletWorld::update() {
  attached.find_objects();
  move_with_corrections(now, attached);
  place_proxies();
  lift();
}

void BulletWorld::before_query() {
  const StepLock lock;
  guarded([&] {
    if (!now.stepping) place_proxies();
  });
}

void BulletWorld::place_proxies() {
  attached.find_objects();
  if (!now.terrain->decks().empty()) decks.move();
  sleep.wake_disturbed();
  attached.list();
  maybe_below_.clear();
  for (int k : attached.awake) {
    if (attached.slots[k].ground != nullptr)
      guarded([&] { place(attached.slots[k]); });
    else if (attached.slots[k].kind.is_own)
      maybe_below_.push_back(k);
  }
}

void BulletWorld::lift() {
  for (int body : lift_bodies(now, attached, maybe_below_)) {
    ++rescues;
    sleep.wake(body);
    for (int k : attached.bodies[body].slots)
      if (attached.slots[k].ground != nullptr) place(attached.slots[k]);
  }
}

void BulletWorld::after_step() {
  now.stepping = false;
  now.duration = now.world.getDispatchInfo().m_timeStep;
  now.time += now.duration;
  now.terrain->note_shown(now.time);
  narrowphase.restore_told();
  if (!now.terrain->decks().empty()) decks.end_step();
  narrowphase.press_soil();
  sleep.note_rest();
}

void BulletWorld::place(Slot& slot) {
  btRigidBody& ground = *slot.ground;
  ground.setLinearVelocity(btVector3(0, 0, 0));
  ground.setAngularVelocity(btVector3(0, 0, 0));
  slot.shape->low = slot.shape->high = btVector3(0, 0, 0);
  ground.forceActivationState(ISLAND_SLEEPING);  // Bullet wakes whatever lies on a kinematic body that is awake
  if (slot.object == nullptr) return;
  if (slot.belt.speed != 0.0) slot.stir();  // PyBullet would let it sleep while it creeps
  const btTransform& pose = slot.object->getWorldTransform();
  btVector3 low, high;
  slot.object->getCollisionShape()->getAabb(pose, low, high);
  slot.read_velocity();
  const Vec3 at = from_bullet(pose.getOrigin());
  if (!std::isfinite(at.x + at.y + at.z + norm2(slot.linear) + norm2(slot.angular))) return;
  const double size = norm(from_bullet(high - low)), angle = std::min(1.0, norm(slot.angular) * now.duration);
  const Bounds bounds = Bounds{from_bullet(low), from_bullet(high)}.grown(now.margin_in(now.duration) + angle * size);
  const Bounds swept = bounds.swept(slot.linear * now.duration);
  const NearbyGround& near = slot.near = now.terrain->near(swept, now.time, now.duration);
  if (slot.kind.is_own) {
    const bool has_decks = !now.terrain->decks().empty();  // which are ground above bodies that are far below
    if (has_decks || near.highest > (pose * to_bullet(slot.body_shape->parts[0].inside)).z())
      maybe_below_.push_back(static_cast<int>(&slot - attached.slots.data()));
  }
  const double by_decks = decks.find_near(slot, bounds);
  const double moved = std::max((norm(near.velocity) + near.spread) * now.duration, by_decks);
  const Bounds reach = swept.grown(moved);
  const bool is_above = near.highest < reach.low.z, is_far = is_above && by_decks < 0.0;
  bound(now.world, ground, is_far ? nullptr : &reach);
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
  if (norm(near.velocity) + near.spread > 0.0) slot.stir();
}

}  // namespace smartmesh
