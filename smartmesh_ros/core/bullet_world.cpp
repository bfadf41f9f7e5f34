#include "bullet_world.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionShapes/btConvexShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "contact_points.h"
#include "ground_algorithm.h"
#include "link_motion.h"

namespace smartmesh {

namespace {

// Part of the ground that a shape may touch in the step: around its box, grown by the way it may come.
class ShapeReach final : public Reach {
 public:
  ShapeReach(const Convex& shape, const Pose& pose, double grown) : shape_(shape), pose_(pose), grown_(grown) {
    is_ball_ = !shape.cylinder && shape.core.vertices.size() == 1;
  }

  bool touches(const Vec3& centre, double radius) const override {
    const double most = grown_ + radius;
    if (is_ball_) {
      const double limit = shape_.radius + most;
      return norm2(centre - pose_.at) <= limit * limit;
    }
    const Vec3 q = pose_.to_local(centre);
    return shape_.bounds.grown(most).meets({q, q});
  }

 private:
  const Convex& shape_;
  const Pose& pose_;
  double grown_;
  bool is_ball_;
};

bool is_of(const btCollisionObject& object, int body, int link) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return collider->m_multiBody->getUserIndex2() == body && collider->m_link == link;
  return link < 0 && object.getUserIndex2() == body;
}

}  // namespace

void BulletWorld::enter(btDiscreteDynamicsWorld* world) {
  world_ = world;
  slots_.clear();
  slot_of_ground_.clear();
  if (world != nullptr) register_algorithm(*world, this);
}

btCollisionObject* BulletWorld::find(int body, int link) const {
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k)
    if (is_of(*objects[k], body, link)) return objects[k];
  return nullptr;
}

int BulletWorld::attach(int body, int link, int proxy) {
  btCollisionObject* object = find(body, link);
  auto* ground = btRigidBody::upcast(find(proxy, -1));
  if (object == nullptr || ground == nullptr) return -1;
  std::size_t k = 0;
  while (k < slots_.size() && slots_[k].used) ++k;
  if (k == slots_.size()) slots_.emplace_back();
  Slot& slot = slots_[k];
  slot.used = slot.enabled = true;
  slot.body = body, slot.link = link, slot.proxy = proxy;
  slot.object = object, slot.ground = ground;
  slot.shape = std::make_unique<GroundShape>(&surface, &time);
  slot_of_ground_[slot.shape.get()] = static_cast<int>(k);
  ground->setCollisionShape(slot.shape.get());
  ground->setCollisionFlags((ground->getCollisionFlags() & ~btCollisionObject::CF_STATIC_OBJECT) |
                            btCollisionObject::CF_KINEMATIC_OBJECT);
  place(slot);
  return static_cast<int>(k);
}

void BulletWorld::detach(int index) {
  Slot& slot = slots_[index];
  slot_of_ground_.erase(slot.shape.get());
  slot = Slot{};
}

void BulletWorld::enable(int index, bool enabled) { slots_[index].enabled = enabled; }

void BulletWorld::find_objects() {
  std::unordered_map<long, Slot*> by_body, by_proxy;
  for (Slot& slot : slots_) {
    if (!slot.used) continue;
    slot.object = nullptr, slot.ground = nullptr;
    by_body[(static_cast<long>(slot.body) << 20) + slot.link + 1] = &slot;
    by_proxy[slot.proxy] = &slot;
  }
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    btCollisionObject* object = objects[k];
    int body = object->getUserIndex2(), link = -1;
    if (auto* collider = btMultiBodyLinkCollider::upcast(object))
      body = collider->m_multiBody->getUserIndex2(), link = collider->m_link;
    const auto found = by_body.find((static_cast<long>(body) << 20) + link + 1);
    if (found != by_body.end()) found->second->object = object;
    const auto ground = link < 0 ? by_proxy.find(body) : by_proxy.end();
    if (ground != by_proxy.end()) {
      auto* proxy = btRigidBody::upcast(object);
      if (proxy != nullptr && proxy->getCollisionShape() == ground->second->shape.get()) ground->second->ground = proxy;
    }
  }
}

void BulletWorld::before_step() {
  if (world_ == nullptr) return;
  find_objects();
  for (Slot& slot : slots_)
    if (slot.used && slot.ground != nullptr) place(slot);
}

void BulletWorld::after_step() {
  if (world_ == nullptr) return;
  duration = world_->getDispatchInfo().m_timeStep;
  time += duration;
}

void BulletWorld::place(Slot& slot) {
  btRigidBody& ground = *slot.ground;
  ground.setLinearVelocity(btVector3(0, 0, 0));
  ground.setAngularVelocity(btVector3(0, 0, 0));
  slot.shape->low = slot.shape->high = btVector3(0, 0, 0);
  if (slot.object == nullptr || !slot.enabled) return;
  const btTransform& pose = slot.object->getWorldTransform();
  if (auto* collider = btMultiBodyLinkCollider::upcast(slot.object)) {
    const LinkVelocity velocity = link_velocity(*collider->m_multiBody, collider->m_link);
    slot.linear = velocity.linear, slot.angular = velocity.angular;
  } else if (auto* rigid = btRigidBody::upcast(slot.object)) {
    slot.linear = from_bullet(rigid->getLinearVelocity()), slot.angular = from_bullet(rigid->getAngularVelocity());
  }
  btVector3 low, high;
  slot.object->getCollisionShape()->getAabb(pose, low, high);
  const double half = 0.5 * std::max(high.x() - low.x(), high.y() - low.y());
  const Vec3 at = from_bullet(pose.getOrigin());
  if (!std::isfinite(at.x + at.y + at.z + norm2(slot.linear) + norm2(slot.angular))) return;
  const double size = norm(from_bullet(high - low)), turn = std::min(1.0, norm(slot.angular) * duration);
  GroundMotion motion;
  if (carry_velocity && duration > 0.0) motion = surface.motion_at(at.x, at.y, half, time, duration, at.z);
  const double moved = norm(motion.linear) * duration;
  const double grown = margin + turn * size + moved;
  const btVector3 by(grown, grown, grown), travel = to_bullet(slot.linear * duration);
  low.setMin(low + travel), high.setMax(high + travel);
  btTransform foot;
  foot.setIdentity();
  foot.setOrigin(motion.known ? to_bullet(motion.foot) : pose.getOrigin());
  slot.shape->low = low - by - foot.getOrigin();
  slot.shape->high = high + by - foot.getOrigin();
  slot.shape->origin = foot.getOrigin();
  ground.setWorldTransform(foot);
  ground.setInterpolationWorldTransform(foot);
  ground.setLinearVelocity(to_bullet(motion.linear));
  ground.setAngularVelocity(to_bullet(motion.angular));
  if (moved > 0.0 || norm2(motion.angular) > 0.0) slot.object->activate();
}

const Convex* BulletWorld::convex_of_part(Slot& slot, const btCollisionShape& shape) {
  auto& known = slot.shapes[&shape];
  if (known == nullptr) {
    known = std::make_unique<Convex>();
    if (!convex_of(static_cast<const btConvexShape&>(shape), *known)) known->reach = -1.0;
  }
  return known->reach < 0.0 ? nullptr : known.get();
}

void BulletWorld::touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
                        btPersistentManifold& manifold, double step) {
  const auto found = slot_of_ground_.find(ground.getCollisionShape());
  if (found == slot_of_ground_.end()) return;
  Slot& slot = slots_[found->second];
  if (slot.object != body.getCollisionObject() || !slot.enabled) {
    manifold.setNumContacts(0);
    return;
  }
  const Convex* shape = convex_of_part(slot, *body.getCollisionShape());
  if (shape == nullptr) return;
  ++touched;
  const Pose pose = from_bullet(body.getWorldTransform());
  const auto& proxy = *slot.ground;
  Approach approach;
  approach.centre = from_bullet(slot.object->getWorldTransform().getOrigin());
  approach.angular = slot.angular - from_bullet(proxy.getAngularVelocity());
  approach.linear = slot.linear - from_bullet(proxy.getVelocityInLocalPoint(to_bullet(approach.centre) -
                                                                            proxy.getWorldTransform().getOrigin()));
  approach.duration = step, approach.margin = margin;
  const double arm = norm(pose.at - approach.centre) + shape->reach;
  const double grown = margin + (norm(approach.linear) + norm(approach.angular) * arm) * step;
  Bounds bounds;
  const Vec3 extent{grown, grown, grown};
  for (int k = 0; k < 8; ++k)
    bounds.add(pose.to_world({k & 1 ? shape->bounds.high.x : shape->bounds.low.x,
                              k & 2 ? shape->bounds.high.y : shape->bounds.low.y,
                              k & 4 ? shape->bounds.high.z : shape->bounds.low.z}));
  if (!std::isfinite(norm2(bounds.low) + norm2(bounds.high) + grown)) {
    manifold.setNumContacts(0);
    return;
  }
  bounds = {bounds.low - extent, bounds.high + extent};
  surface.gather(bounds, time, ShapeReach(*shape, pose, grown), patch_);
  contacts_.clear();
  find_contacts(*shape, pose, patch_, approach, contacts_);
  read_contacts(manifold, before_);
  choose_contacts(approach, before_, contacts_);
  write_contacts(contacts_, before_, body, ground, approach, manifold);
}

}  // namespace smartmesh
