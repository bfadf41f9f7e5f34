#include "bullet/world.h"

#include <algorithm>

#include <BulletCollision/BroadphaseCollision/btBroadphaseInterface.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/friction_axes.h"
#include "bullet/shape_parts.h"

namespace smartmesh {

namespace {

// Where new proxies wait, apart from each other, for the bounds of their objects [m].
constexpr double FAR_AWAY = 1e15, APART = 1e6;

btBroadphaseProxy* new_proxy(btDiscreteDynamicsWorld& world, int place, btCollisionObject* object, int group,
                             int mask) {
  const btVector3 at(FAR_AWAY + place * APART, 0.0, 0.0);
  const int kind = object == nullptr ? EMPTY_SHAPE_PROXYTYPE : object->getCollisionShape()->getShapeType();
  return world.getBroadphase()->createProxy(at, at, kind, object, group, mask, world.getDispatcher());
}

// Makes the broadphase of a world anew: it forgets all pairs of objects, their contacts, and how objects moved. Pairs
// are then found in an order that is that of the objects; it is the order of contacts in the solver, and so decides on
// the last bits of a step.
void renew_broadphase(btDiscreteDynamicsWorld& world) {
  btBroadphaseInterface& broadphase = *world.getBroadphase();
  btDispatcher* dispatcher = world.getDispatcher();
  auto& objects = world.getCollisionObjectArray();
  struct Known {
    btCollisionObject* object;
    int number, group, mask;
  };
  std::vector<Known> known;
  for (int k = 0; k < objects.size(); ++k) {
    btBroadphaseProxy* proxy = objects[k]->getBroadphaseHandle();
    if (proxy == nullptr) continue;
    known.push_back({objects[k], proxy->m_uniqueId, proxy->m_collisionFilterGroup, proxy->m_collisionFilterMask});
  }
  std::sort(known.begin(), known.end(), [](const Known& a, const Known& b) { return a.number < b.number; });
  // Objects keep their numbers, by which PyBullet's own saved states know them. Bullet's broadphase gives one number
  // after the other; its simple one gives the number that was freed last.
  for (auto it = known.rbegin(); it != known.rend(); ++it)
    broadphase.destroyProxy(it->object->getBroadphaseHandle(), dispatcher);
  broadphase.resetPool(dispatcher);
  int number = 0;
  for (const Known& it : known) {
    while (++number < it.number) broadphase.destroyProxy(new_proxy(world, 0, nullptr, 0, 0), dispatcher);
    it.object->setBroadphaseHandle(new_proxy(world, number, it.object, it.group, it.mask));
  }
}

}  // namespace

BulletWorld::BulletWorld(btDiscreteDynamicsWorld& world, int of_number)
    : number(of_number),
      now{world, &nothing_},
      attached(world),
      sleep(now, attached),
      decks(now, attached),
      narrowphase(now, attached, decks) {
  algorithms_.enter(world);
  world.getSolverInfo().m_solverMode |= SOLVER_ENABLE_FRICTION_DIRECTION_CACHING;  // read the directions of our points
  // Contacts are solved in the order of their bodies. Bullet's own order depends on where it allocated memory, and on
  // what is drawn.
  world.getDispatchInfo().m_deterministicOverlappingPairs = true;
}

// The dispatcher of another world does not know the ground.
bool BulletWorld::is_in(const btDiscreteDynamicsWorld* world) const {
  return &now.world == world && algorithms_.are_in(*world);
}

void BulletWorld::release() {
  for (std::size_t k = 0; k < attached.slots.size(); ++k)
    if (attached.slots[k].used) detach(static_cast<int>(k));
  now.terrain = &nothing_;
  now.soil = nullptr;
  sleep.set_rules({});
  owned = now.drawn = false;
}

void BulletWorld::leave() {
  release();
  untouchable_.leave(now.world);
}

bool BulletWorld::attach(int index, const ObjectName& name, int proxy, const BodyShape& shape) {
  btCollisionObject* object = find_object(now.world, name);
  btCollisionObject* found = proxy < 0 ? nullptr : find_object(now.world, {proxy, -1});
  btRigidBody* ground = found == nullptr ? nullptr : btRigidBody::upcast(found);
  if (object == nullptr || (proxy >= 0 && ground == nullptr)) return false;
  require_attachable(*object);
  if (ground != nullptr) require_convex_if_moved(*object);
  if (!is_hooked_) hook_.enter(now.world), is_hooked_ = true;
  if (index >= static_cast<int>(attached.slots.size())) attached.slots.resize(index + 1);
  Slot& slot = attached.slots[index];
  slot = Slot{};
  slot.used = true;
  slot.body = name.body, slot.link = name.link, slot.proxy = proxy;
  slot.object = object, slot.ground = ground;
  slot.kind.is_solid = ground != nullptr;
  slot.body_shape = shape;
  slot.rest.radius = bounding_radius(*object);
  attached.body(name.body).slots.push_back(index);
  attached.note_change();
  if (ground == nullptr) return true;
  attached.body(proxy).proxy_of = index;
  AttachedBody& body = attached.body(name.body);
  if (body.friction == nullptr) body.friction = FrictionAxes::enter(*object, now.world);
  slot.shape = std::make_unique<GroundShape>(this, index);
  slot.shape_before = ground->getCollisionShape();
  ground->setCollisionShape(slot.shape.get());
  return true;
}

void BulletWorld::detach(int index) {
  attached.find_objects();
  wake(index);
  const Slot& slot = attached.slots[index];
  if (slot.ground != nullptr) {  // nobody removed it from PyBullet: it stays, where nothing meets it
    slot.ground->setCollisionShape(slot.shape_before);
    const btVector3 away(0, 0, FAR_BELOW);
    slot.ground->setWorldTransform(btTransform(btQuaternion::getIdentity(), away));
    now.world.getBroadphase()->setAabb(slot.ground->getBroadphaseHandle(), away, away, now.world.getDispatcher());
  }
  if (attached.has_body(slot.body) && attached.bodies[slot.body].slots.size() == 1)
    FrictionAxes::leave(std::exchange(attached.bodies[slot.body].friction, nullptr));
  attached.remove(index);
}

void BulletWorld::note_removed(int body) {
  if (attached.has_body(body))
    for (int k : attached.bodies[body].slots)
      if (attached.slots[k].rest.asleep) sleep.note_awake(attached.slots[k]);
  attached.note_removed(body);
}

bool BulletWorld::is_ground(int body) const {
  if (body < 0) return false;
  if (body < static_cast<int>(attached.bodies.size()) && attached.bodies[body].proxy_of >= 0) return true;
  const btCollisionObject* object = now.drawn ? find_object(now.world, {body, -1}) : nullptr;
  return object != nullptr && is_untouchable(*object);
}

bool BulletWorld::keep_apart(int body) {
  btCollisionObject* object = find_object(now.world, {body, -1});
  if (object != nullptr) untouchable_.keep_apart(now.world, *object);
  return object != nullptr;
}

void BulletWorld::drive(int index, const Belt& belt) {
  attached.find_objects();
  attached.slots[index].belt = belt;
  wake(index);
}

void BulletWorld::wake(int index) {
  if (const int body = attached.slots[index].body; body >= 0) sleep.wake(body);
}

void BulletWorld::forget() {
  sleep.wake_all();
  renew_broadphase(now.world);
  sleep.forget();
  for (Slot& slot : attached.slots) {
    slot.pull = slot.ground_angular = {};
    slot.still = 0.0, slot.anchor = SlotMemory{}.anchor;
    slot.on_soil.clear();
  }
  auto& objects = now.world.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    objects[k]->setDeactivationTime(0.0);
    // PyBullet's `restoreState` leaves the inertia as it lay before.
    if (auto* body = btRigidBody::upcast(objects[k])) body->setCenterOfMassTransform(body->getWorldTransform());
  }
}

}  // namespace smartmesh
