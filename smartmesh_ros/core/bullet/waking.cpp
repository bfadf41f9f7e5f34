// What wakes attached bodies that sleep. Bullet wakes an island in the step in which something awake comes near; here
// is what wakes it beside that.
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/world.h"

namespace smartmesh {

namespace {

// Returns true if something that physics does not move has a velocity, as a conveyor has.
bool has_velocity(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object)) {
    const btMultiBody& body = *collider->m_multiBody;
    return !body.getBaseVel().isZero() || !body.getBaseOmega().isZero();
  }
  const auto* body = btRigidBody::upcast(&object);
  return body != nullptr && !(body->getLinearVelocity().isZero() && body->getAngularVelocity().isZero());
}

bool moves_itself(const btCollisionObject& object) { return !object.isStaticOrKinematicObject() && object.isActive(); }

}  // namespace

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
  ground_stands_ = terrain->revision() == revision_ && !terrain->moves(time);
  revision_ = terrain->revision();
  std::vector<int> disturbed;
  for (int k : asleep_)
    if (slots_[k].rest.asleep && is_disturbed(slots_[k])) disturbed.push_back(k);
  for (int k : disturbed) follow_corrections(bodies_[slots_[k].body], 0.0);
  for (int body : corrected_) follow_corrections(bodies_[body], rules_.tolerance.change);
  corrected_.clear();
  raise_contacts();
  for (int k : disturbed) wake_body(slots_[k].body);
  find_ways();
  while (!vacated_.empty()) {  // what wakes wakes what it touches
    const Bounds bounds = vacated_.back();
    vacated_.pop_back();
    wake_in(bounds);
  }
}

// Notes where awake bodies come to in the coming step.
void BulletWorld::find_ways() {
  const auto add_way = [&](const btCollisionObject& object, const Vec3& velocity) {
    Bounds bounds = bounds_of(object);
    const Bounds start = bounds;
    bounds.add(start.low + velocity * duration), bounds.add(start.high + velocity * duration);
    vacated_.push_back(bounds);
  };
  for (int k : awake_) {
    Slot& slot = slots_[k];
    if (slot.object == nullptr || slot.object->isStaticOrKinematicObject()) continue;
    read_velocity(slot);
    add_way(*slot.object, slot.linear);
  }
  for (const Beside& it : beside_) {
    const auto* body = btRigidBody::upcast(it.object);
    if (body != nullptr && moves_itself(*body)) add_way(*body, from_bullet(body->getLinearVelocity()));
  }
}

bool BulletWorld::is_disturbed(Slot& slot) {
  if (slot.object == nullptr || !sleeps(*slot.object)) return true;  // Bullet or its user woke it
  if (!(slot.rest.pose == slot.object->getWorldTransform())) return true;
  if (slot.rest.is_first && is_pushed(*slot.object)) return true;
  if (slot.rest.is_first && slot.is_robot && motors_of(*slot.object) != bodies_[slot.body].sleeper.motors) return true;
  return is_another_ground(slot);
}

// The ground is compared again after an update of it, and in each step while it moves.
bool BulletWorld::is_another_ground(Slot& slot) {
  Rest& rest = slot.rest;
  if (rest.calm && ground_stands_) return false;
  const bool same_tiles = rest.layout == terrain->layout();
  if (!same_tiles) terrain->blocks_under(rest.bounds, time, rest.blocks), rest.layout = terrain->layout();
  const Updates now = terrain->updates_of(rest.blocks, time);
  if (rest.calm && same_tiles && rest.updates == now.count) return false;
  GroundUnder& found = ground_;
  terrain->ground_under(rest.bounds, time, found);
  rest.updates = now.count;
  rest.calm = !now.settles;
  rest.samples = 0;
  rest.corrected = correction(rest.ground, found, rest.samples);
  if (rest.samples > 0) corrected_.push_back(slot.body);
  if (differs(rest.ground, found, rules_.tolerance)) return true;
  if (!now.moves) return false;
  GroundUnder& next = next_;
  terrain->ground_under(rest.bounds, time + duration, next);
  rest.calm = rest.calm && next.heights == found.heights && next.vertices == found.vertices;
  return differs(rest.ground, next, rules_.tolerance);
}

// Wakes what lies where something moved or went that Bullet wakes nobody for: it does not move by physics, or slept.
void BulletWorld::wake_beside_others() {
  look_beside();
  for (Beside& it : beside_) {
    const btTransform& pose = it.object->getWorldTransform();
    const bool is_moved = !(it.pose == pose) || (it.object->isStaticOrKinematicObject() && has_velocity(*it.object));
    if (is_moved && !moves_itself(*it.object)) vacated_.insert(vacated_.end(), {it.bounds, bounds_of(*it.object)});
    if (is_moved) it.pose = pose, it.bounds = bounds_of(*it.object);
  }
}

// Looks where objects are that are not attached or do not move by physics, if PyBullet made or removed any. What is
// gone has left its place.
void BulletWorld::look_beside() {
  if (others_listed_) return;
  others_listed_ = true;
  std::unordered_map<const btCollisionObject*, Beside> before;
  for (const Beside& it : beside_) before[it.object] = it;
  beside_.clear();
  const auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const btCollisionObject& object = *objects[k];
    if (object.getCollisionShape()->getShapeType() == GROUND_SHAPE_TYPE || object.getBroadphaseHandle() == nullptr)
      continue;
    if (is_untouchable(object) || (!object.isStaticOrKinematicObject() && is_attached(object))) continue;
    const auto known = before.find(&object);
    beside_.push_back(known == before.end() ? Beside{&object, object.getWorldTransform(), bounds_of(object)}
                                            : known->second);
    if (known != before.end()) before.erase(known);
  }
  for (const auto& [object, it] : before) vacated_.push_back(it.bounds);
}

bool BulletWorld::is_attached(const btCollisionObject& object) const {
  const int body = name_of(object).body;
  return body >= 0 && body < static_cast<int>(bodies_.size()) && !bodies_[body].roles.empty();
}

}  // namespace smartmesh
