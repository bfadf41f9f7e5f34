#include "bullet/narrowphase.h"

#include <algorithm>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>

#include "bullet/object_velocity.h"
#include "bullet/shape_parts.h"
#include "contact/foundation.h"

namespace smartmesh {

namespace {

// Returns the pose of a shape that is turned in Bullet's frame of it.
Pose pose_of(const Convex& shape, const btTransform& at) {
  Pose pose = from_bullet(at);
  for (Vec3& row : pose.rotation.row) row = rotated(shape.orientation.inverse(), row);
  return pose;
}

}  // namespace

void Narrowphase::touch(Slot& slot, const btCollisionObjectWrapper& part, btPersistentManifold& with_ground,
                        btPersistentManifold* with_soil, double step) {
  const Convex* shape = slot.convex_of_part(*part.getCollisionShape());
  if (shape == nullptr) return;
  const Pose pose = pose_of(*shape, part.getWorldTransform());
  const Approach approach = approach_of(slot, step);
  const auto* rigid = btRigidBody::upcast(slot.object);
  const Vec3 pull = rigid != nullptr ? from_bullet(rigid->getTotalForce() * (rigid->getInvMass() * step))
                                     : from_bullet(now_.world.getGravity() * step);
  Approach body = approach;
  body.linear = slot.linear, body.ground = {};
  search_.find_on_decks(*shape, pose, *now_.terrain, slot.decks, now_.time, body);
  SoilBelow soil;
  if (with_soil != nullptr) {
    const double reach = shape->bounding_radius + approach.contact_distance(pose.at, shape->bounding_radius);
    const double above = -lowest(*shape, -pose.rotation.row[2]);
    const double top = now_.soil->has(pose.at, now_.time) ? INFINITE : pose.at.z + above;
    soil = {&now_.soil->lattice.map(), top, now_.soil->is_all_around(pose.at, reach, now_.time)};
    contacts_.clear(), rows_.clear();
    read_contacts(*with_soil, before_);
    if (now_.soil->within_map(pose.at, now_.time) > -shape->bounding_radius) {
      SoilPart& known = slot.on_soil[slot.part_number(*part.getCollisionShape())];
      SoilPart asked = now_.stepping ? SoilPart{} : known;
      now_.soil->touch(*shape, pose, on_soil(slot, step, step), now_.stepping ? known : asked, contacts_, rows_);
      known.contacts = now_.stepping ? with_soil : nullptr;
    }
    tell(slot, approach, pull, *with_soil);
  }
  contacts_.clear(), rows_.clear();
  read_contacts(with_ground, before_);
  if (!soil.is_all || search_.has_decks() || !now_.terrain->meshes().empty())
    touch_ground(slot, *shape, pose, soil, approach, pull);
  tell(slot, approach, pull, with_ground);
  slot.pull = pull;
}

void Narrowphase::tell(Slot& slot, const Approach& approach, const Vec3& pull, btPersistentManifold& manifold) {
  const double step = approach.duration;
  // Friction against rolling, and that of robots if PyBullet's `frictionERP` is zero, aim at the proxy's velocity.
  if (!rows_.empty() && (rows_[0].friction.rolling + rows_[0].friction.spinning > 0.0 || anchor_time(step) == 0.0))
    slot.ground_angular = contacts_[0].ground.angular;
  if (const auto* rigid = btRigidBody::upcast(slot.object)) {
    for (ContactRow& row : rows_)
      row.mass = 1.0 / rigid->computeImpulseDenominator(to_bullet(row.at), to_bullet(row.normal));
    // Bullet's anisotropic friction acts against velocities alone.
    static const std::vector<OldContact> NONE;
    const auto& before = slot.object->hasAnisotropicFriction() ? NONE : before_;
    find_slips(contacts_, before, approach, pull, slot.pull, mass_of(*slot.object), rows_);
  }
  const bool ground_is_b = manifold.getBody0() == slot.object;
  const double slop = now_.world.getSolverInfo().m_linearSlop, anchor = anchor_time(step);
  const FrameVelocity proxy = velocity_of(*slot.ground);
  manifold.setNumContacts(0);
  const std::size_t count = std::min<std::size_t>(contacts_.size(), MANIFOLD_CACHE_SIZE);
  for (std::size_t k = 0; k < count; ++k) {
    const Contact& contact = contacts_[k];
    const Carrier* carrier = carried_.carrier_of(contact.deck);
    btPersistentManifold& into = carrier == nullptr ? manifold : carried_.manifold_with(*carrier, slot, manifold);
    const btCollisionObject& ground = carrier == nullptr ? *slot.ground : *carrier->object;
    const FrameVelocity& motion = carrier == nullptr ? proxy : carrier->velocity;
    const Touching touching{*slot.object, ground, motion, ground_is_b, step, slop, anchor};
    told.push_back(add_contact(contact, rows_[k], matching(contact, before_, step), touching, into));
  }
}

void Narrowphase::touch_ground(const Slot& slot, const Convex& shape, const Pose& pose, const SoilBelow& soil,
                               const Approach& approach, const Vec3& pull) {
  const double step = approach.duration;
  search_.find(shape, pose, *now_.terrain, now_.time, approach.with_margin(slot.near.spread * step), contacts_, soil);
  if (soil.map != nullptr) {
    const auto is_soil = [&](const Contact& contact) {
      return contact.deck < 0 && !contact.on_mesh && now_.soil->is_all_around(contact.point, AT_EDGE, now_.time);
    };
    contacts_.erase(std::remove_if(contacts_.begin(), contacts_.end(), is_soil), contacts_.end());
  }
  choose_contacts(shape, pose, approach, before_, contacts_);
  search_.find_rotations(contacts_);
  const bool has_material = now_.terrain->has_material();
  if (has_material)
    for (Contact& contact : contacts_)
      if (contact.deck < 0) contact.material = now_.terrain->material(contact.point.x, contact.point.y, now_.time);
  BodySurface own = surface_of(*slot.object, *slot.ground);
  if (slot.belt.speed != 0.0) own.belt = slot.belt_axis(), own.mass = mass_of(*slot.object);
  const btContactSolverInfo& solver = now_.world.getSolverInfo();
  find_rows(shape, pose, contacts_, approach, own,
            {solver.m_erp2, solver.m_linearSlop, solver.m_restitutionVelocityThreshold}, rows_);
  if (!has_material) return;
  lay_on_foundation(shape, pose, approach, own, contacts_, rows_);
  resist_rolling(contacts_, approach, pull, rows_);
}

std::optional<Contact> Narrowphase::deepest_contact(Slot& slot) {
  std::optional<Contact> deepest;
  if (slot.object == nullptr) return deepest;
  const auto look = [&](const btCollisionShape& part, const btTransform& at) {
    const Convex* shape = part.isConvex() ? slot.convex_of_part(part) : nullptr;
    if (shape == nullptr) return;
    Approach still;
    still.centre = from_bullet(at.getOrigin());
    const Pose pose = pose_of(*shape, at);
    search_.find_on_decks(*shape, pose, *now_.terrain, all_decks(*now_.terrain, slot.body), now_.time, still);
    search_.find(*shape, pose, *now_.terrain, now_.time, still, contacts_);
    for (const Contact& contact : contacts_)
      if (contact.distance <= 0.0 && (!deepest || contact.distance < deepest->distance)) deepest = contact;
  };
  for_each_part(*slot.object->getCollisionShape(), slot.object->getWorldTransform(), look);
  return deepest;
}

// A robot rests on those of its links alike that touched the soil in the last step.
OnSoil Narrowphase::on_soil(const Slot& slot, double step, double ahead) const {
  int count = 0;
  for (int k : attached_.bodies[slot.body].slots)
    for (const auto& [number, part] : attached_.slots[k].on_soil) count += part.sums.area > 0.0;
  OnSoil found;
  found.pose = from_bullet(slot.object->getWorldTransform());
  found.soil = now_.soil->motion_around(found.pose.at, slot.rest.radius, now_.time, ahead);
  found.approach = approach_of(slot, step);
  found.approach.linear = slot.linear - found.soil.velocity_at(found.pose.at);
  found.approach.angular = slot.angular - found.soil.angular;
  if (slot.belt.speed != 0.0) found.belt = slot.belt_axis();
  found.mass = mass_of(*slot.object) / std::max(count, 1);
  found.time = now_.time;
  return found;
}

void Narrowphase::press_soil() {
  if (now_.soil == nullptr) return;
  for (Slot& slot : attached_.slots) {
    if (slot.on_soil.empty()) continue;
    if (slot.object != nullptr && slot.ground != nullptr && slot.object->isActive()) {
      slot.read_velocity();
      now_.soil->press(on_soil(slot, now_.duration, -now_.duration), slot.on_soil);
    }
    for (auto& [number, part] : slot.on_soil) part.contacts = nullptr;  // also of what fell asleep in this step
  }
  now_.soil->next();
}

void Narrowphase::restore_told() {
  for (const TruePoint& it : told) {
    it.point->m_distance1 = it.distance;
    it.point->m_positionWorldOnA = it.on_a, it.point->m_positionWorldOnB = it.on_b;
  }
  told.clear();
}

double Narrowphase::anchor_time(double step) const {
  const double share = now_.world.getSolverInfo().m_frictionERP;  // of a distance, closed in a step
  return share > 0.0 ? step / share : 0.0;
}

Approach Narrowphase::approach_of(const Slot& slot, double step) const {
  Approach approach;
  approach.centre = from_bullet(slot.object->getWorldTransform().getOrigin());
  approach.angular = slot.angular;
  approach.linear = slot.linear - slot.near.velocity;
  approach.duration = step;
  approach.margin = now_.margin_in(step);
  approach.gravity = from_bullet(now_.world.getGravity());
  approach.ground = slot.near.velocity;
  approach.ahead = step;
  return approach;
}

}  // namespace smartmesh
