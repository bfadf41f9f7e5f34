#include "world.h"

#include <algorithm>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "link_motion.h"

// Bullet's own library, which defines this, exports nothing.
void btMultiBody::wakeUp() {
  m_sleepTimer = 0;
  m_awake = true;
}

namespace smartmesh {

namespace {

// Depth at which the bounds of proxies lie that are switched off [m].
constexpr double FAR_AWAY = 1e6;

bool is_of(const btCollisionObject& object, int body, int link) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return collider->m_multiBody->getUserIndex2() == body && collider->m_link == link;
  return link < 0 && object.getUserIndex2() == body;
}

}  // namespace

BulletWorld::BulletWorld(WorldPlace place) : place_(place) { look(); }

void BulletWorld::look() {
  btDiscreteDynamicsWorld* now = *place_;
  // A new world may lie where the one before was; its dispatcher does not know the ground.
  if (now != world_ || (now != nullptr && !algorithms_.are_in(*now))) enter(now);
}

void BulletWorld::enter(btDiscreteDynamicsWorld* world) {
  world_ = world;
  soil = nullptr;
  ++worlds_;
  owned = drawn = false;
  slots_.clear();
  roles_.clear();
  slot_of_ground_.clear();
  if (world != nullptr) algorithms_.enter(*world);
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
  for (int k = 0; k < objects.size(); ++k)
    if (is_of(*objects[k], body, link)) return objects[k];
  return nullptr;
}

void BulletWorld::release() {
  for (std::size_t k = 0; k < slots_.size(); ++k)
    if (slots_[k].used) detach(static_cast<int>(k));
  surface.set_tiles({}, {});
  soil = nullptr;
  owned = drawn = false;
}

std::vector<BulletWorld::Role>& BulletWorld::roles_of(int body) {
  if (body >= static_cast<int>(roles_.size())) roles_.resize(body + 1);
  return roles_[body];
}

bool BulletWorld::attach(int index, int body, int link, int proxy) {
  btCollisionObject* object = find(body, link);
  btCollisionObject* found = proxy < 0 ? nullptr : find(proxy, -1);
  btRigidBody* ground = found == nullptr ? nullptr : btRigidBody::upcast(found);
  if (object == nullptr || (proxy >= 0 && ground == nullptr)) return false;
  if (index >= static_cast<int>(slots_.size())) slots_.resize(index + 1);
  Slot& slot = slots_[index];
  slot = Slot{};
  slot.used = true;
  slot.body = body, slot.link = link, slot.proxy = proxy;
  slot.object = object, slot.ground = ground;
  roles_of(body).push_back({index, false});
  if (ground == nullptr) return true;
  roles_of(proxy).push_back({index, true});
  slot.shape = std::make_unique<GroundShape>(this);
  slot_of_ground_[slot.shape.get()] = index;
  slot.shape_before = ground->getCollisionShape();
  ground->setCollisionShape(slot.shape.get());
  ground->setCollisionFlags((ground->getCollisionFlags() & ~btCollisionObject::CF_STATIC_OBJECT) |
                            btCollisionObject::CF_KINEMATIC_OBJECT);
  return true;
}

void BulletWorld::detach(int index) {
  find_objects();
  Slot& slot = slots_[index];
  if (slot.ground != nullptr) slot.ground->setCollisionShape(slot.shape_before);
  for (int body : {slot.body, slot.proxy}) {
    if (body < 0) continue;
    auto& roles = roles_of(body);
    roles.erase(std::remove_if(roles.begin(), roles.end(), [&](const Role& role) { return role.slot == index; }),
                roles.end());
  }
  if (slot.shape != nullptr) slot_of_ground_.erase(slot.shape.get());
  slot = Slot{};
}

void BulletWorld::enable(int index, bool enabled) {
  Slot& slot = slots_[index];
  if (slot.enabled == enabled) return;
  slot.enabled = enabled;
  if (enabled || slot.ground == nullptr) return;
  // Its bounds lie where nothing is, so that the step after it is switched on makes a new pair.
  btBroadphaseProxy* bounds = slot.ground->getBroadphaseHandle();
  const btVector3 away(index, 0.0, -FAR_AWAY);
  world_->getBroadphase()->setAabb(bounds, away, away, world_->getDispatcher());
  world_->getPairCache()->removeOverlappingPairsContainingProxy(bounds, world_->getDispatcher());
}

bool BulletWorld::keep_apart(int body) {
  btCollisionObject* object = find(body, -1);
  if (object != nullptr) untouchable_.keep_apart(*world_, *object);
  return object != nullptr;
}

void BulletWorld::drive(int index, const Belt& belt) {
  find_objects();
  Slot& slot = slots_[index];
  slot.belt = belt;
  if (slot.object != nullptr) wake(slot);
}

void BulletWorld::wake_all() {
  find_objects();
  for (const Slot& slot : slots_)
    if (slot.object != nullptr && slot.enabled) wake(slot);
}

void BulletWorld::find_objects() {
  for (Slot& slot : slots_) slot.object = nullptr, slot.ground = nullptr;
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    btCollisionObject* object = objects[k];
    int body = object->getUserIndex2(), link = -1;
    if (auto* collider = btMultiBodyLinkCollider::upcast(object))
      body = collider->m_multiBody->getUserIndex2(), link = collider->m_link;
    if (body < 0 || body >= static_cast<int>(roles_.size())) continue;
    for (const Role& role : roles_[body]) {
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
  const btTransform& pose = slot.object->getWorldTransform();
  const btQuaternion turn = pose.getRotation();
  state = {{from_bullet(pose.getOrigin()), {turn.x(), turn.y(), turn.z(), turn.w()}}, slot.linear, slot.angular};
  return true;
}

}  // namespace smartmesh
