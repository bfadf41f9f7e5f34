#include "bullet/world.h"

#include <algorithm>
#include <stdexcept>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/broadphase.h"
#include "bullet/link_motion.h"

namespace smartmesh {

ObjectName name_of(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return {collider->m_multiBody->getUserIndex2(), collider->m_link};
  return {object.getUserIndex2(), -1};
}

BulletWorld::BulletWorld(WorldPlace place) : place_(place) { look(); }

void BulletWorld::look() {
  btDiscreteDynamicsWorld* now = *place_;
  // A new world may lie where the one before was; its dispatcher does not know the ground.
  if (now != world_ || (now != nullptr && !algorithms_.are_in(*now))) enter(now);
}

void BulletWorld::enter(btDiscreteDynamicsWorld* world) {
  world_ = world;
  terrain = &nothing_;
  soil = nullptr;
  ++worlds_;
  owned = drawn = false;
  rescues_ = 0;
  slots_.clear();
  bodies_.clear();
  gone_ = 0;
  is_hooked_ = stepping_ = false;
  beside_.clear();
  rules_ = {};
  vacated_.clear();
  told_.clear(), carried_.clear();
  ++sleep_changes_, objects_known_ = -1;
  if (world == nullptr) return;
  algorithms_.enter(*world);
  world->getSolverInfo().m_solverMode |= SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;  // read the directions of our points
  // Contacts are solved in the order of their bodies. Bullet's own order depends on where it allocated memory, and on
  // what is drawn.
  world->getDispatchInfo().m_deterministicOverlappingPairs = true;
}

void require_rigid(const btCollisionObject& object) {
  if (object.getInternalType() == btCollisionObject::CO_SOFT_BODY)
    throw std::invalid_argument("it is soft, and only rigid bodies and robots collide with the map");
}

bool BulletWorld::leave() {
  look();
  if (world_ == nullptr) return true;
  release();
  untouchable_.leave(*world_);
  world_ = nullptr;
  return false;
}

btCollisionObject* BulletWorld::find(int body, int link) const {
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const ObjectName name = name_of(*objects[k]);
    if (name.body == body && name.link == link) return objects[k];
  }
  return nullptr;
}

void BulletWorld::release() {
  for (std::size_t k = 0; k < slots_.size(); ++k)
    if (slots_[k].used) detach(static_cast<int>(k));
  terrain = &nothing_;
  rules_ = {};
  soil = nullptr;
  owned = drawn = false;
}

BulletWorld::OfBody& BulletWorld::of_body(int body) {
  if (body >= static_cast<int>(bodies_.size())) bodies_.resize(body + 1);
  return bodies_[body];
}

bool BulletWorld::attach(int index, int body, int link, int proxy, const BodyShape& shape) {
  btCollisionObject* object = find(body, link);
  btCollisionObject* found = proxy < 0 ? nullptr : find(proxy, -1);
  btRigidBody* ground = found == nullptr ? nullptr : btRigidBody::upcast(found);
  if (object == nullptr || (proxy >= 0 && ground == nullptr)) return false;
  require_rigid(*object);
  if (!is_hooked_) hook_.enter(*world_), is_hooked_ = true;
  if (index >= static_cast<int>(slots_.size())) slots_.resize(index + 1);
  Slot& slot = slots_[index];
  slot = Slot{};
  slot.used = true, slot.is_robot = robot_of(*object) != nullptr;
  slot.body = body, slot.link = link, slot.proxy = proxy;
  slot.object = object, slot.ground = ground;
  slot.kind.is_solid = ground != nullptr;
  slot.body_shape = shape;
  slot.rest.radius = bounding_radius(*object);
  of_body(body).roles.push_back({index, false});
  ++sleep_changes_, objects_known_ = -1;
  if (ground == nullptr) return true;
  of_body(proxy).roles.push_back({index, true});
  slot.shape = std::make_unique<GroundShape>(this, index);
  slot.shape_before = ground->getCollisionShape();
  ground->setCollisionShape(slot.shape.get());
  return true;
}

void BulletWorld::detach(int index) {
  find_objects();
  Slot& slot = slots_[index];
  if (slot.body >= 0) wake_body(slot.body);
  gone_ -= (slot.body < 0) + slot.lost_proxy();
  if (slot.ground != nullptr) {  // nobody removed it from PyBullet: it stays, where nothing meets it
    slot.ground->setCollisionShape(slot.shape_before);
    const btVector3 away(0, 0, FAR_BELOW);
    slot.ground->setWorldTransform(btTransform(btQuaternion::getIdentity(), away));
    world_->getBroadphase()->setAabb(slot.ground->getBroadphaseHandle(), away, away, world_->getDispatcher());
  }
  for (int body : {slot.body, slot.proxy}) {
    if (body < 0) continue;
    auto& roles = of_body(body).roles;
    roles.erase(std::remove_if(roles.begin(), roles.end(), [&](const Role& role) { return role.slot == index; }),
                roles.end());
  }
  slot = Slot{};
  ++sleep_changes_, objects_known_ = -1;
}

void BulletWorld::note_removed(int body) {
  objects_known_ = -1;
  if (body < 0 || body >= static_cast<int>(bodies_.size())) return;
  for (const Role& role : bodies_[body].roles) {
    Slot& slot = slots_[role.slot];
    ++gone_;
    if (role.is_proxy) {
      slot.ground = nullptr, slot.proxy = -1;
      continue;
    }
    if (slot.rest.asleep) note_awake(slot);
    slot.object = nullptr, slot.body = -1;
  }
  bodies_[body] = {};
}

std::vector<int> BulletWorld::find_gone(bool of_proxies) const {
  std::vector<int> found;
  for (std::size_t k = 0; gone_ > 0 && k < slots_.size(); ++k) {
    const bool is_gone = slots_[k].body < 0;
    if (slots_[k].used && (of_proxies ? !is_gone && slots_[k].lost_proxy() : is_gone))
      found.push_back(static_cast<int>(k));
  }
  return found;
}

bool BulletWorld::is_ground(int body) const {
  if (body < 0) return false;
  const bool is_known = body < static_cast<int>(bodies_.size());
  if (is_known && std::any_of(bodies_[body].roles.begin(), bodies_[body].roles.end(),
                              [](const Role& role) { return role.is_proxy; }))
    return true;
  const btCollisionObject* object = drawn ? find(body, -1) : nullptr;
  return object != nullptr && is_untouchable(*object);
}

bool BulletWorld::keep_apart(int body) {
  btCollisionObject* object = find(body, -1);
  if (object != nullptr) untouchable_.keep_apart(*world_, *object);
  return object != nullptr;
}

void BulletWorld::drive(int index, const Belt& belt) {
  find_objects();
  slots_[index].belt = belt;
  wake(index);
}

void BulletWorld::find_objects() {
  if (objects_known_ == world_->getNumCollisionObjects()) return;
  objects_known_ = world_->getNumCollisionObjects();
  others_listed_ = false;
  carried_layout_ = -1;
  for (Slot& slot : slots_) slot.object = nullptr, slot.ground = nullptr;
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    btCollisionObject* object = objects[k];
    const auto [body, link] = name_of(*object);
    if (body < 0 || body >= static_cast<int>(bodies_.size())) continue;
    for (const Role& role : bodies_[body].roles) {
      Slot& slot = slots_[role.slot];
      if (!role.is_proxy && slot.link == link) slot.object = object;
      if (role.is_proxy && object->getCollisionShape() == slot.shape.get()) slot.ground = btRigidBody::upcast(object);
    }
  }
}

void BulletWorld::read_velocity(Slot& slot) const {
  if (auto* collider = btMultiBodyLinkCollider::upcast(slot.object)) {
    const LinkVelocity velocity = link_velocity(*collider->m_multiBody, collider->m_link);
    slot.linear = velocity.linear, slot.angular = velocity.angular;
  } else if (auto* rigid = btRigidBody::upcast(slot.object)) {
    slot.linear = from_bullet(rigid->getLinearVelocity()), slot.angular = from_bullet(rigid->getAngularVelocity());
  }
}

bool BulletWorld::read(int index, BodyState& state) {
  Slot& slot = slots_[index];
  if (slot.object == nullptr) return false;
  read_velocity(slot);
  state = {body_pose(slot.object->getWorldTransform()), slot.linear, slot.angular};
  return true;
}

}  // namespace smartmesh
