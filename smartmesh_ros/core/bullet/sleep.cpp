// Sleep of attached bodies. Bullet puts islands to sleep, which keep their contacts, and wakes them in the step in which
// something awake comes near; here is when a body is still enough, and what wakes it beside contacts.
#include <algorithm>
#include <cmath>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraint.h>
#include <BulletDynamics/Featherstone/btMultiBodyDynamicsWorld.h>

#include "world.h"

namespace smartmesh {

namespace {

// Gravity for which SleepRules::after is meant [m/s^2]. Under a weaker one all that falls or rolls is slower.
constexpr double EARTH = 9.81;

bool sleeps(const btCollisionObject& object) { return object.getActivationState() == ISLAND_SLEEPING; }

// Returns the time that a body must be still [s]: in it a body falls by the same distance as on Earth.
double time_still(const SleepRules& rules, double gravity) {
  return rules.after * std::sqrt(EARTH / std::min(EARTH, gravity));
}

Bounds bounds_of(const btCollisionObject& object) {
  const btBroadphaseProxy& proxy = *object.getBroadphaseHandle();
  return {from_bullet(proxy.m_aabbMin), from_bullet(proxy.m_aabbMax)};
}

// Moves what Bullet knows of a sleeping object's bounds.
void lift_bounds(const btCollisionObject& object, const btVector3& up, btDiscreteDynamicsWorld& world) {
  btBroadphaseProxy* bounds = const_cast<btBroadphaseProxy*>(object.getBroadphaseHandle());
  world.getBroadphase()->setAabb(bounds, bounds->m_aabbMin + up, bounds->m_aabbMax + up, world.getDispatcher());
}

// Returns true if something that physics does not move has a velocity, as a conveyor has.
bool has_velocity(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object)) {
    const btMultiBody& body = *collider->m_multiBody;
    return !body.getBaseVel().isZero() || !body.getBaseOmega().isZero();
  }
  const auto* body = btRigidBody::upcast(&object);
  return body != nullptr && !(body->getLinearVelocity().isZero() && body->getAngularVelocity().isZero());
}

}  // namespace

void BulletWorld::set_rules(const SleepRules& rules) {
  wake_all();
  rules_ = rules;
}

// Lets a body that PyBullet may put to sleep by its own rule start anew.
void BulletWorld::stir(const Slot& slot) {
  if (btMultiBody* robot = robot_of(*slot.object)) robot->wakeUp();
  slot.object->activate();
}

void BulletWorld::wake_all() {
  find_objects();
  for (std::size_t k = 0; k < bodies_.size(); ++k) wake_body(static_cast<int>(k));
}

void BulletWorld::wake_body(int body) {
  OfBody& it = of_body(body);
  btCollisionObject* object = nullptr;
  for (const Role& role : it.roles) {
    if (role.is_proxy) continue;
    Slot& slot = slots_[role.slot];
    slot.rest.still = 0.0;
    if (slot.object != nullptr && !slot.object->isStaticOrKinematicObject()) object = slot.object;
    if (slot.rest.asleep) note_awake(slot);
  }
  it.still = 0.0, it.wanted = false;
  if (object != nullptr) {
    const bool slept = sleeps(*object);
    rouse(*object, it.sleeper.before, world_->getGravity());
    if (slept && stepping_) add_weight(*object, world_->getGravity());
  }
  it.sleeper = {};
}

// Wakes the sleeping bodies whose bounds meet some bounds.
void BulletWorld::wake_in(const Bounds& bounds) {
  struct Waker final : btBroadphaseAabbCallback {
    std::vector<int> found;
    bool process(const btBroadphaseProxy* proxy) override {
      const auto& object = *static_cast<const btCollisionObject*>(proxy->m_clientObject);
      if (sleeps(object)) found.push_back(name_of(object).body);
      return true;
    }
  } waker;
  world_->getBroadphase()->aabbTest(to_bullet(bounds.low), to_bullet(bounds.high), waker);
  for (int body : waker.found)
    if (body >= 0 && body < static_cast<int>(bodies_.size()) && !bodies_[body].roles.empty()) wake_body(body);
}

void BulletWorld::note_asleep(Slot& slot) {
  Rest& rest = slot.rest;
  rest.asleep = true, rest.layout = -1;
  rest.is_first = moving_slot(of_body(slot.body)) == &slot;
  rest.pose = slot.object->getWorldTransform();
  rest.bounds = bounds_of(*slot.object);
  surface.ground_under(rest.bounds, time, rest.ground);
  rest.calm = false, rest.corrected = 0.0, rest.samples = 0;
  Sleeper& sleeper = of_body(slot.body).sleeper;
  sleeper.motors = motors_of(*slot.object), sleeper.followed = 0.0;
  forget_forces(*slot.object);
  if (slot.ground != nullptr) slot.ground->setLinearVelocity({0.0, 0.0, 0.0}), slot.ground->setAngularVelocity({0.0, 0.0, 0.0});
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
    if (body.driven || slot.belt.speed != 0.0) slot.rest.still = 0.0;
    body.still = std::min(body.still, slot.rest.still);
  }
}

// Notes which awake bodies are driven in the coming step, and lets those stay awake that are no longer still but were to
// sleep.
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

void BulletWorld::wake_disturbed() {
  list_slots();
  if (stepping_) note_driven();
  for (int k : awake_) {  // somebody put it to sleep through PyBullet
    Slot& slot = slots_[k];
    if (slot.object != nullptr && sleeps(*slot.object) && !slot.object->isStaticOrKinematicObject()) note_asleep(slot);
  }
  find_joined();
  list_slots();
  if (world_->getGravity() != gravity_) wake_all();
  gravity_ = world_->getGravity();
  if (asleep_.empty()) {
    beside_.clear(), vacated_.clear();
    others_listed_ = false;
    return;
  }
  wake_beside_others();
  ground_stands_ = surface.revision() == revision_ && !surface.moves(time);
  revision_ = surface.revision();
  std::vector<int> disturbed;
  for (int k : asleep_)
    if (slots_[k].rest.asleep && is_disturbed(slots_[k])) disturbed.push_back(k);
  for (int k : disturbed) follow_corrections(bodies_[slots_[k].body], 0.0);
  for (int body : corrected_) follow_corrections(bodies_[body], rules_.tolerance.change);
  corrected_.clear();
  raise_contacts();
  for (int k : disturbed) wake_body(slots_[k].body);
  find_reached();
  while (!vacated_.empty()) {  // what wakes wakes what it touches
    const Bounds bounds = vacated_.back();
    vacated_.pop_back();
    wake_in(bounds);
  }
}

// Notes where awake bodies come to in the coming step.
void BulletWorld::find_reached() {
  const auto reach = [&](const btCollisionObject& object, const btVector3& velocity) {
    Bounds bounds = bounds_of(object), ahead = bounds;
    const Vec3 way = from_bullet(velocity) * duration;
    ahead = {bounds.low + way, bounds.high + way};
    bounds.add(ahead.low), bounds.add(ahead.high);
    vacated_.push_back(bounds);
  };
  for (int k : awake_) {
    Slot& slot = slots_[k];
    if (slot.object == nullptr || slot.object->isStaticOrKinematicObject()) continue;
    read_velocity(slot);
    reach(*slot.object, to_bullet(slot.linear));
  }
  for (const Beside& it : beside_)
    if (const auto* body = btRigidBody::upcast(it.object); body != nullptr && !body->isStaticOrKinematicObject() && body->isActive())
      reach(*body, body->getLinearVelocity());
}

bool BulletWorld::is_disturbed(Slot& slot) {
  if (!sleeps(*slot.object)) return true;  // Bullet or its user woke it
  if (!(slot.rest.pose == slot.object->getWorldTransform())) return true;
  if (slot.rest.is_first && is_pushed(*slot.object)) return true;
  if (slot.rest.is_first && slot.is_robot && motors_of(*slot.object) != bodies_[slot.body].sleeper.motors) return true;
  return is_another_ground(slot);
}

// The ground is compared again after an update of it, and in each step while it moves.
bool BulletWorld::is_another_ground(Slot& slot) {
  Rest& rest = slot.rest;
  if (rest.calm && ground_stands_) return false;
  const bool same_tiles = rest.layout == surface.layout();
  if (!same_tiles) surface.blocks_under(rest.bounds, time, rest.blocks), rest.layout = surface.layout();
  const Updates now = surface.updates_of(rest.blocks, time);
  if (rest.calm && same_tiles && rest.updates == now.count) return false;
  GroundUnder& found = ground_;
  surface.ground_under(rest.bounds, time, found);
  rest.updates = now.count;
  rest.calm = !now.settles;
  rest.samples = 0;
  rest.corrected = correction(rest.ground, found, rest.samples);
  if (rest.samples > 0) corrected_.push_back(slot.body);
  if (differs(rest.ground, found, rules_.tolerance)) return true;
  if (!now.moves) return false;
  GroundUnder& next = next_;
  surface.ground_under(rest.bounds, time + duration, next);
  rest.calm = rest.calm && next.heights == found.heights && next.vertices == found.vertices;
  return differs(rest.ground, next, rules_.tolerance);
}

// Wakes what lies where something moved or went that Bullet wakes nobody for: it does not move by physics, or slept.
void BulletWorld::wake_beside_others() {
  look_beside();
  for (Beside& it : beside_) {
    const bool is_fixed = it.object->isStaticOrKinematicObject();
    const bool moves_itself = !is_fixed && it.object->isActive();
    const btTransform& pose = it.object->getWorldTransform();
    const bool is_moved = !(it.pose == pose) || (is_fixed && has_velocity(*it.object));
    if (is_moved && !moves_itself) vacated_.insert(vacated_.end(), {it.bounds, bounds_of(*it.object)});
    if (is_moved) it.pose = pose, it.bounds = bounds_of(*it.object);
  }
}

// Looks where objects are that are not attached or do not move by physics, if PyBullet made or removed any. What is gone has
// left its place.
void BulletWorld::look_beside() {
  if (others_listed_) return;
  others_listed_ = true;
  std::unordered_map<const btCollisionObject*, Beside> before;
  for (const Beside& it : beside_) before[it.object] = it;
  beside_.clear();
  const auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const btCollisionObject& object = *objects[k];
    if (object.getCollisionShape()->getShapeType() == GROUND_SHAPE_TYPE || object.getBroadphaseHandle() == nullptr) continue;
    if (!object.isStaticOrKinematicObject() && is_attached(object)) continue;
    const auto known = before.find(&object);
    beside_.push_back(known == before.end() ? Beside{&object, object.getWorldTransform(), bounds_of(object)} : known->second);
    if (known != before.end()) before.erase(known);
  }
  for (const auto& [object, it] : before) vacated_.push_back(it.bounds);
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

bool BulletWorld::is_attached(const btCollisionObject& object) const {
  const int body = name_of(object).body;
  return body >= 0 && body < static_cast<int>(bodies_.size()) && !bodies_[body].roles.empty();
}

// Moves a sleeping body with the corrections of the ground under it since it fell asleep, on average, if that is more than
// `least` [m]. A robot moves as a whole.
void BulletWorld::follow_corrections(OfBody& body, double least) {
  double sum = 0.0;
  int count = 0;
  Slot* any = nullptr;
  for (const Role& role : body.roles) {
    Slot& slot = slots_[role.slot];
    if (role.is_proxy || !slot.rest.asleep) continue;
    any = &slot;
    if (slot.rest.samples > 0) sum += slot.rest.corrected, ++count;
  }
  const double by = count > 0 ? sum / count - body.sleeper.followed : 0.0;
  const btMultiBody* robot = any == nullptr ? nullptr : robot_of(*any->object);
  if (!(std::abs(by) > least) || (robot != nullptr && robot->getBaseCollider()->isStaticOrKinematicObject())) return;
  body.sleeper.followed += by;
  const btVector3 up(0.0, 0.0, by);
  lift(*any->object, by);
  for (const Role& role : body.roles) {
    Slot& slot = slots_[role.slot];
    if (role.is_proxy || !slot.rest.asleep) continue;
    slot.rest.pose = slot.object->getWorldTransform();
    lift_bounds(*slot.object, up, *world_);
    slot.rest.bounds = bounds_of(*slot.object);
    if (slot.ground == nullptr) continue;
    lift(*slot.ground, by);
    slot.shape->origin += up;
    lift_bounds(*slot.ground, up, *world_);
    slot.rest.raised += by;
  }
  any_raised_ = true;
  ++sleep_changes_;
}

// Moves the contacts of bodies that followed corrections.
void BulletWorld::raise_contacts() {
  if (!any_raised_) return;
  btDispatcher& dispatcher = *world_->getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    const Slot* slot = slot_of(*manifold.getBody0());
    if (slot == nullptr) slot = slot_of(*manifold.getBody1());
    if (slot == nullptr || slot->rest.raised == 0.0) continue;
    const btVector3 up(0.0, 0.0, slot->rest.raised);
    for (int p = 0; p < manifold.getNumContacts(); ++p)
      manifold.getContactPoint(p).m_positionWorldOnA += up, manifold.getContactPoint(p).m_positionWorldOnB += up;
  }
  for (Slot& slot : slots_) slot.rest.raised = 0.0;
  any_raised_ = false;
}

// Returns the slot of a ground proxy; null of other objects.
const Slot* BulletWorld::slot_of(const btCollisionObject& ground) const {
  const auto found = slot_of_ground_.find(ground.getCollisionShape());
  return found == slot_of_ground_.end() ? nullptr : &slots_[found->second];
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
bool BulletWorld::can_sleep(const OfBody& body, const std::vector<bool>& is_trusted) const {
  bool is_borne = body.supported;
  for (const Role& role : body.roles) {
    const Slot& slot = slots_[role.slot];
    if (role.is_proxy || slot.object == nullptr || slot.ground == nullptr) return false;
    btMultiBody* robot = robot_of(*slot.object);
    if (std::find(joined_.begin(), joined_.end(), robot) != joined_.end()) return false;
    is_borne |= (role.slot < static_cast<int>(is_trusted.size()) && is_trusted[role.slot]) || (robot != nullptr && robot->getBaseCollider()->isStaticOrKinematicObject());
  }
  return is_borne && joints_rest(*slots_[body.roles.front().slot].object, rules_.joint);
}

std::vector<int> BulletWorld::find_resting(const std::vector<bool>& is_trusted) {
  std::vector<int> still, found;
  const double after = time_still(rules_, world_->getGravity().length());
  find_objects();
  list_slots();
  for (int k : awake_) {
    const Slot& slot = slots_[k];
    if (slot.object == nullptr || moving_slot(bodies_[slot.body]) != &slot) continue;
    const OfBody& body = bodies_[slot.body];
    if (!body.wanted && body.still >= after && std::isfinite(body.still)) still.push_back(slot.body);
  }
  if (still.empty()) return found;
  find_supported();
  for (int body : still)
    if (can_sleep(bodies_[body], is_trusted)) found.push_back(body);
  return found;
}

void BulletWorld::put_to_sleep(const std::vector<int>& bodies) {
  find_objects();
  for (int body : bodies) {
    OfBody& it = of_body(body);
    const Slot* slot = moving_slot(it);
    if (slot == nullptr || it.wanted || sleeps(*slot->object)) continue;
    it.sleeper.before = let_sleep(*slot->object);
    it.wanted = true;
  }
}

}  // namespace smartmesh
