// What wakes attached bodies that sleep.
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/moved_bodies.h"
#include "bullet/sleep.h"
#include "bullet/untouchable.h"
#include "step/correction.h"

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

void Sleep::wake_all() {
  attached_.find_objects();
  for (std::size_t k = 0; k < attached_.bodies.size(); ++k) wake(static_cast<int>(k));
}

void Sleep::wake(int body) {
  AttachedBody& it = attached_.body(body);
  btCollisionObject* object = nullptr;
  for (int k : it.slots) {
    Slot& slot = attached_.slots[k];
    slot.still = 0.0;
    if (slot.object != nullptr && !slot.object->isStaticOrKinematicObject()) object = slot.object;
    if (slot.rest.asleep) note_awake(slot);
  }
  it.still = 0.0;
  if (object != nullptr) {
    const bool slept = sleeps(*object);
    rouse(*object, it.sleeper.before, now_.world.getGravity());
    if (slept && now_.stepping) add_weight(*object, now_.world.getGravity());
  }
  it.sleeper = {};
}

// Wakes the sleeping bodies whose bounds meet some bounds.
void Sleep::wake_in(const Bounds& bounds) {
  struct Waker final : btBroadphaseAabbCallback {
    std::vector<int> found;
    bool process(const btBroadphaseProxy* proxy) override {
      const auto& object = *static_cast<const btCollisionObject*>(proxy->m_clientObject);
      if (sleeps(object)) found.push_back(name_of(object).body);
      return true;
    }
  } waker;
  now_.world.getBroadphase()->aabbTest(to_bullet(bounds.low), to_bullet(bounds.high), waker);
  for (int body : waker.found)
    if (attached_.has_body(body)) wake(body);
}

void Sleep::wake_disturbed() {
  attached_.list();
  if (now_.stepping) note_driven();
  for (int k : attached_.awake) {  // somebody put it to sleep through PyBullet
    Slot& slot = attached_.slots[k];
    if (slot.object != nullptr && sleeps(*slot.object) && !slot.object->isStaticOrKinematicObject()) note_asleep(slot);
  }
  find_joined();
  attached_.list();
  if (now_.world.getGravity() != gravity_) wake_all();
  gravity_ = now_.world.getGravity();
  if (attached_.asleep.empty()) {
    beside_.clear(), vacated_.clear();
    beside_of_ = -1;
    return;
  }
  wake_beside_others();
  ground_stands_ = now_.terrain->revision() == revision_ && !now_.terrain->moves(now_.time);
  revision_ = now_.terrain->revision();
  std::vector<int> disturbed;
  for (int k : attached_.asleep)
    if (attached_.slots[k].rest.asleep && is_disturbed(attached_.slots[k])) disturbed.push_back(k);
  for (int k : disturbed) follow_corrections(attached_.bodies[attached_.slots[k].body], 0.0);
  for (int body : corrected_) follow_corrections(attached_.bodies[body], rules_.tolerance.change);
  corrected_.clear();
  raise_contacts();
  for (int k : disturbed) wake(attached_.slots[k].body);
  find_ways();
  while (!vacated_.empty()) {  // what wakes wakes what it touches
    const Bounds bounds = vacated_.back();
    vacated_.pop_back();
    wake_in(bounds);
  }
}

// Notes where awake bodies come to in the coming step.
void Sleep::find_ways() {
  const auto add_way = [&](const btCollisionObject& object, const Vec3& velocity) {
    vacated_.push_back(bounds_of(object).swept(velocity * now_.duration));
  };
  for (int k : attached_.awake) {
    Slot& slot = attached_.slots[k];
    if (slot.object == nullptr || slot.object->isStaticOrKinematicObject()) continue;
    slot.read_velocity();
    add_way(*slot.object, slot.linear);
  }
  for (const Beside& it : beside_) {
    const auto* body = btRigidBody::upcast(it.object);
    if (body != nullptr && moves_itself(*body)) add_way(*body, from_bullet(body->getLinearVelocity()));
  }
}

bool Sleep::is_disturbed(Slot& slot) {
  if (slot.object == nullptr || !sleeps(*slot.object)) return true;  // Bullet or its user woke it
  if (!(slot.rest.pose == slot.object->getWorldTransform())) return true;
  const AttachedBody& body = attached_.bodies[slot.body];
  if (attached_.moving_slot(body) == &slot &&
      (is_pushed(*slot.object) || motors_of(*slot.object) != body.sleeper.motors))
    return true;
  return is_another_ground(slot);
}

// The ground is compared again after an update of it, and in each step while it moves.
bool Sleep::is_another_ground(Slot& slot) {
  Rest& rest = slot.rest;
  if (rest.calm && ground_stands_) return false;
  const bool same_tiles = rest.layout == now_.terrain->layout();
  if (!same_tiles)
    now_.terrain->blocks_under(rest.bounds, now_.time, rest.blocks), rest.layout = now_.terrain->layout();
  const Updates now = now_.terrain->updates_of(rest.blocks, now_.time);
  if (rest.calm && same_tiles && rest.updates == now.count) return false;
  now_.terrain->ground_under(rest.bounds, now_.time, ground_);
  rest.updates = now.count;
  rest.calm = !now.settles;
  rest.samples = 0;
  rest.corrected = correction(rest.ground, ground_, rest.bounds.low.z, rest.samples);
  if (rest.samples > 0) {
    GroundReader reader = now_.terrain->reader(now_.time, INSTANT);
    if (!is_borne_by(nullptr, slot, reader, now_, attached_)) rest.samples = 0;
  }
  if (rest.samples > 0) corrected_.push_back(slot.body);
  if (differs(rest.ground, ground_, rules_.tolerance)) return true;
  if (!now.moves) return false;
  now_.terrain->ground_under(rest.bounds, now_.time + now_.duration, next_);
  rest.calm = rest.calm && next_.heights == ground_.heights && next_.vertices == ground_.vertices;
  return differs(rest.ground, next_, rules_.tolerance);
}

// Wakes what lies where something moved or went that Bullet wakes nobody for: it does not move by physics, or slept.
void Sleep::wake_beside_others() {
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
void Sleep::look_beside() {
  if (beside_of_ == attached_.searches()) return;
  beside_of_ = attached_.searches();
  std::unordered_map<const btCollisionObject*, Beside> before;
  for (const Beside& it : beside_) before[it.object] = it;
  beside_.clear();
  const auto& objects = now_.world.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const btCollisionObject& object = *objects[k];
    if (object.getCollisionShape()->getShapeType() == GROUND_SHAPE_TYPE || object.getBroadphaseHandle() == nullptr)
      continue;
    if (is_untouchable(object) || (!object.isStaticOrKinematicObject() && attached_.has_body(name_of(object).body)))
      continue;
    const auto known = before.find(&object);
    beside_.push_back(known == before.end() ? Beside{&object, object.getWorldTransform(), bounds_of(object)}
                                            : known->second);
    if (known != before.end()) before.erase(known);
  }
  for (const auto& [object, it] : before) vacated_.push_back(it.bounds);
}

void Sleep::forget() {
  vacated_.clear(), beside_.clear();
  revision_ = beside_of_ = -1;
}

}  // namespace smartmesh
