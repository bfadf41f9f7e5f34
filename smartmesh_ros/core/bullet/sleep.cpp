// When attached bodies fall asleep. Bullet puts islands to sleep, which keep their contacts; here is which bodies are
// still.
#include <algorithm>
#include <cmath>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>

#include "bullet/world.h"

namespace smartmesh {

namespace {

// Gravity for which SleepRules::after is meant [m/s^2]. Under a weaker one all that falls or rolls is slower.
constexpr double EARTH = 9.81;

// Returns the time that a body must be still [s]: in it a body falls by the same distance as on Earth.
double time_still(const SleepRules& rules, double gravity) {
  return rules.after * std::sqrt(EARTH / std::min(EARTH, gravity));
}

}  // namespace

void BulletWorld::set_rules(const SleepRules& rules) {
  wake_all();
  rules_ = rules;
}

void BulletWorld::note_asleep(Slot& slot) {
  Rest& rest = slot.rest;
  rest.asleep = true, rest.layout = -1;
  rest.is_first = moving_slot(of_body(slot.body)) == &slot;
  rest.pose = slot.object->getWorldTransform();
  rest.bounds = bounds_of(*slot.object);
  terrain->ground_under(rest.bounds, time, rest.ground);
  rest.calm = false, rest.corrected = 0.0, rest.samples = 0;
  Sleeper& sleeper = of_body(slot.body).sleeper;
  sleeper.motors = motors_of(*slot.object), sleeper.followed = 0.0;
  forget_forces(*slot.object);
  if (slot.ground != nullptr)
    slot.ground->setLinearVelocity({0.0, 0.0, 0.0}), slot.ground->setAngularVelocity({0.0, 0.0, 0.0});
  ++sleep_changes_;
}

void BulletWorld::note_awake(Slot& slot) {
  slot.rest.asleep = false;
  slot.rest.still = 0.0;
  vacated_.push_back(slot.rest.bounds);
  slot.rest.ground.clear();
  ++sleep_changes_;
}

// Lists the slots by whether their bodies sleep.
void BulletWorld::list_slots() {
  if (listed_at_ == sleep_changes_) return;
  listed_at_ = sleep_changes_;
  awake_.clear(), asleep_.clear();
  for (std::size_t k = 0; k < slots_.size(); ++k)
    if (slots_[k].used) (slots_[k].rest.asleep ? asleep_ : awake_).push_back(static_cast<int>(k));
}

// Counts how long bodies are still, and notes which of them Bullet put to sleep in the step.
void BulletWorld::note_rest() {
  const bool may_sleep = std::isfinite(rules_.after);
  list_slots();
  for (int k : awake_)
    if (slots_[k].body >= 0) bodies_[slots_[k].body].still = std::numeric_limits<double>::infinity();
  for (int k : awake_) {
    Slot& slot = slots_[k];
    if (slot.object == nullptr || slot.object->isStaticOrKinematicObject()) continue;
    if (sleeps(*slot.object)) {
      note_asleep(slot), look_beside();
      continue;
    }
    OfBody& body = bodies_[slot.body];
    if (may_sleep) slot.rest.note(from_bullet(slot.object->getWorldTransform()), rules_.distance, duration);
    if (body.driven || slot.belt.speed != 0.0 || is_on_carrier(slot)) slot.rest.still = 0.0;
    body.still = std::min(body.still, slot.rest.still);
  }
  if (may_sleep) put_resting_to_sleep();
}

// Notes which awake bodies are driven in the coming step, and lets those stay awake that are no longer still but were
// to sleep.
void BulletWorld::note_driven() {
  const btVector3 gravity = world_->getGravity();
  const double after = time_still(rules_, gravity.length());
  if (!std::isfinite(after)) return;
  for (int k : awake_) {
    Slot& slot = slots_[k];
    if (slot.object == nullptr || moving_slot(bodies_[slot.body]) != &slot || sleeps(*slot.object)) continue;
    OfBody& body = bodies_[slot.body];
    body.driven = is_acted_on(*slot.object, gravity);
    if (body.wanted && (body.driven || body.still < after)) wake_body(slot.body);
  }
}

// A constraint that comes or goes may hold anything; the pivot of one that holds a robot may be moved at any time.
void BulletWorld::find_joined() {
  auto& world = static_cast<btMultiBodyDynamicsWorld&>(*world_);
  const int count = world.getNumConstraints() + world.getNumMultiBodyConstraints();
  if (count == constraints_) return;
  constraints_ = count;
  std::size_t before = joined_.size() + rigid_constraints_;
  joined_.clear();
  rigid_constraints_ = world.getNumConstraints();
  for (int k = 0; k < world.getNumMultiBodyConstraints(); ++k) {
    btMultiBodyConstraint& it = *world.getMultiBodyConstraint(k);
    if (it.getMultiBodyA() == it.getMultiBodyB()) continue;
    for (const btMultiBody* robot : {it.getMultiBodyA(), it.getMultiBodyB()})
      if (robot != nullptr) joined_.push_back(robot);
  }
  if (before != joined_.size() + rigid_constraints_) wake_all();
}

// Returns the first link of a body that physics moves; null if there is none.
Slot* BulletWorld::moving_slot(const OfBody& body) {
  for (const Role& role : body.roles) {
    Slot& slot = slots_[role.slot];
    if (!role.is_proxy && slot.object != nullptr && !slot.object->isStaticOrKinematicObject()) return &slot;
  }
  return nullptr;
}

// Notes which bodies something else bore in the last step.
void BulletWorld::find_supported() {
  for (OfBody& body : bodies_) body.supported = false;
  const btDispatcher& dispatcher = *world_->getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *const_cast<btDispatcher&>(dispatcher).getManifoldByIndexInternal(k);
    const int one = name_of(*manifold.getBody0()).body, other = name_of(*manifold.getBody1()).body;
    if (one == other) continue;
    bool bears = false;
    for (int p = 0; p < manifold.getNumContacts(); ++p) bears |= manifold.getContactPoint(p).m_appliedImpulse > 0.0;
    for (int body : {one, other})
      if (bears && body >= 0 && body < static_cast<int>(bodies_.size())) bodies_[body].supported = true;
  }
}

// Returns true if a body that is still may sleep: all its slots have ground, and it rests on something.
bool BulletWorld::can_sleep(const OfBody& body) const {
  bool is_borne = body.supported;
  for (const Role& role : body.roles) {
    const Slot& slot = slots_[role.slot];
    if (role.is_proxy || slot.object == nullptr || slot.ground == nullptr) return false;
    btMultiBody* robot = robot_of(*slot.object);
    if (std::find(joined_.begin(), joined_.end(), robot) != joined_.end()) return false;
    is_borne |= slot.kind.is_remote;
    is_borne |= robot != nullptr && robot->getBaseCollider()->isStaticOrKinematicObject();
  }
  return is_borne && joints_rest(*slots_[body.roles.front().slot].object, rules_.joint);
}

void BulletWorld::put_resting_to_sleep() {
  std::vector<int> still;
  const double after = time_still(rules_, world_->getGravity().length());
  list_slots();
  for (int k : awake_) {
    const Slot& slot = slots_[k];
    if (slot.object == nullptr || moving_slot(bodies_[slot.body]) != &slot) continue;
    const OfBody& body = bodies_[slot.body];
    if (!body.wanted && body.still >= after && std::isfinite(body.still)) still.push_back(slot.body);
  }
  if (still.empty()) return;
  find_supported();
  for (int number : still) {
    OfBody& body = bodies_[number];
    btCollisionObject& object = *moving_slot(body)->object;
    if (!can_sleep(body) || sleeps(object)) continue;
    body.sleeper.before = let_sleep(object);
    body.wanted = true;
  }
}

}  // namespace smartmesh
