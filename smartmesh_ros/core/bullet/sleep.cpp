// When attached bodies fall asleep.
#include <algorithm>
#include <cmath>

#include <BulletDynamics/Featherstone/btMultiBodyConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>

#include "bullet/sleep.h"

namespace smartmesh {

namespace {

// Gravity for which SleepRules::after is meant [m/s^2]. Under a weaker one all that falls or rolls is slower.
constexpr double EARTH = 9.81;

// Returns the time that a body must be still [s]: in it a body falls by the same distance as on Earth.
double time_still(const SleepRules& rules, double gravity) {
  return rules.after * std::sqrt(EARTH / std::min(EARTH, gravity));
}

}  // namespace

void Sleep::set_rules(const SleepRules& rules) {
  wake_all();
  rules_ = rules;
}

void Sleep::note_asleep(Slot& slot) {
  Rest& rest = slot.rest;
  rest.asleep = true, rest.layout = -1;
  rest.pose = slot.object->getWorldTransform();
  rest.bounds = bounds_of(*slot.object);
  now_.terrain->ground_under(rest.bounds, now_.time, rest.ground);
  rest.calm = false, rest.corrected = 0.0, rest.samples = 0;
  Sleeper& sleeper = attached_.body(slot.body).sleeper;
  sleeper.motors = motors_of(*slot.object), sleeper.followed = 0.0;
  forget_forces(*slot.object);
  if (slot.ground != nullptr)
    slot.ground->setLinearVelocity({0.0, 0.0, 0.0}), slot.ground->setAngularVelocity({0.0, 0.0, 0.0});
  attached_.note_rest_change();
}

void Sleep::note_awake(Slot& slot) {
  slot.rest.asleep = false;
  slot.still = 0.0;
  vacated_.push_back(slot.rest.bounds);
  slot.rest.ground.clear();
  attached_.note_rest_change();
}

void Sleep::note_rest() {
  const bool may_sleep = std::isfinite(rules_.after);
  attached_.list();
  for (int k : attached_.awake)
    if (attached_.slots[k].body >= 0) attached_.bodies[attached_.slots[k].body].still = INFINITE;
  for (int k : attached_.awake) {
    Slot& slot = attached_.slots[k];
    if (slot.object == nullptr || slot.object->isStaticOrKinematicObject()) continue;
    if (sleeps(*slot.object)) {
      note_asleep(slot), look_beside();
      continue;
    }
    AttachedBody& body = attached_.bodies[slot.body];
    if (may_sleep) slot.note_still(from_bullet(slot.object->getWorldTransform()), rules_.distance, now_.duration);
    if (body.driven) slot.still = 0.0;
    body.still = std::min(body.still, slot.still);
  }
  if (may_sleep) put_resting_to_sleep();
}

// Notes which awake bodies are driven in the coming step, and lets those stay awake that are no longer still but were
// to sleep.
void Sleep::note_driven() {
  const btVector3 gravity = now_.world.getGravity();
  const double after = time_still(rules_, gravity.length());
  if (!std::isfinite(after)) return;
  for (int k : attached_.awake) {
    Slot& slot = attached_.slots[k];
    if (slot.object == nullptr || attached_.moving_slot(attached_.bodies[slot.body]) != &slot || sleeps(*slot.object))
      continue;
    AttachedBody& body = attached_.bodies[slot.body];
    body.driven = is_acted_on(*slot.object, gravity);
    if (body.sleeper.before && (body.driven || body.still < after)) wake(slot.body);
  }
}

// A constraint that comes or goes may hold anything; the pivot of one that holds a robot may be moved at any time.
void Sleep::find_joined() {
  auto& world = static_cast<btMultiBodyDynamicsWorld&>(now_.world);
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

// Notes which bodies something else bore in the last step.
void Sleep::find_supported() {
  for (AttachedBody& body : attached_.bodies) body.supported = false;
  const btDispatcher& dispatcher = *now_.world.getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *const_cast<btDispatcher&>(dispatcher).getManifoldByIndexInternal(k);
    const int one = name_of(*manifold.getBody0()).body, other = name_of(*manifold.getBody1()).body;
    if (one == other) continue;
    bool bears = false;
    for (int p = 0; p < manifold.getNumContacts(); ++p) bears |= manifold.getContactPoint(p).m_appliedImpulse > 0.0;
    for (int body : {one, other})
      if (bears && body >= 0 && body < static_cast<int>(attached_.bodies.size()))
        attached_.bodies[body].supported = true;
  }
}

// Returns true if a body that is still may sleep: all its slots have ground, and it rests on something.
bool Sleep::can_sleep(const AttachedBody& body) {
  bool is_borne = body.supported;
  for (int k : body.slots) {
    const Slot& slot = attached_.slots[k];
    if (slot.object == nullptr || slot.ground == nullptr) return false;
    btMultiBody* robot = robot_of(*slot.object);
    if (std::find(joined_.begin(), joined_.end(), robot) != joined_.end()) return false;
    is_borne |= slot.kind.is_remote;
    is_borne |= robot != nullptr && robot->getBaseCollider()->isStaticOrKinematicObject();
  }
  return is_borne && joints_rest(*attached_.slots[body.slots.front()].object, rules_.joint);
}

void Sleep::put_resting_to_sleep() {
  std::vector<int> still;
  const double after = time_still(rules_, now_.world.getGravity().length());
  attached_.list();
  for (int k : attached_.awake) {
    const Slot& slot = attached_.slots[k];
    if (slot.object == nullptr || attached_.moving_slot(attached_.bodies[slot.body]) != &slot) continue;
    const AttachedBody& body = attached_.bodies[slot.body];
    if (!body.sleeper.before && body.still >= after && std::isfinite(body.still)) still.push_back(slot.body);
  }
  if (still.empty()) return;
  find_supported();
  for (int number : still) {
    AttachedBody& body = attached_.bodies[number];
    btCollisionObject& object = *attached_.moving_slot(body)->object;
    if (!can_sleep(body) || sleeps(object)) continue;
    body.sleeper.before = let_sleep(object);
  }
}

}  // namespace smartmesh
