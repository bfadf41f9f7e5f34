// Decks in a step: those that bodies carry move with them, bodies find the decks near them, and carriers take the
// reaction.
#include <algorithm>
#include <utility>

#include <BulletCollision/NarrowPhaseCollision/btManifoldPoint.h>

#include "bullet/carrier.h"
#include "bullet/world.h"

namespace smartmesh {

void BulletWorld::find_carriers() {
  const auto& decks = terrain->decks();
  const bool same =
      carried_layout_ == terrain->layout() &&
      std::equal(carried_.begin(), carried_.end(), decks.begin(), [](const Carried& known, const Deck* deck) {
        return known.body == deck->body && known.link == deck->link;
      });
  if (same) return;
  carried_layout_ = terrain->layout();
  const std::vector<Carried> before = std::exchange(carried_, {});
  for (const Deck* deck : decks) {
    Carried now{deck->body, deck->link};
    if (deck->body >= 0) now.object = find(deck->body, deck->link);
    for (const Carried& it : before)
      if (it.body == now.body && it.link == now.link && it.object == now.object) now = it;
    carried_.push_back(now);
  }
}

// Decks that are carried have the pose and the velocity of their carriers now. They are accelerated as the carriers
// were by the last two steps, as far as these agree.
void BulletWorld::move_carried() {
  find_carriers();
  for (std::size_t k = 0; k < carried_.size(); ++k) {
    Deck& deck = *terrain->decks()[k];
    Carried& carried = carried_[k];
    if (deck.body >= 0 && carried.object == nullptr) deck.motion.stop(time);
    if (carried.object == nullptr) continue;
    const btTransform& pose = carried.object->getWorldTransform();
    const btQuaternion q = pose.getRotation();
    const Vec3 arm = from_bullet(pose.getBasis() * to_bullet(deck.place.at));
    FrameSample sample{
        time, from_bullet(pose.getOrigin()) + arm, Quaternion{q.x(), q.y(), q.z(), q.w()} * deck.place.orientation, {}};
    if (carried.object->isStaticOrKinematicObject()) {
      deck.motion.note(sample);
      continue;
    }
    const FrameVelocity velocity = carried.start = velocity_of(*carried.object), &change = carried.change;
    const Vec3 swing = cross(velocity.angular, arm);
    sample.velocity = {velocity.linear + swing, velocity.angular};
    deck.motion.set(sample,
                    {change.linear + cross(change.angular, arm) + cross(velocity.angular, swing), change.angular});
  }
}

// Notes the decks that a body inside some bounds comes near to in the step; returns by how much they may move [m],
// negative if there is none.
double BulletWorld::find_decks(Slot& slot, const Bounds& bounds) {
  slot.decks.clear();
  double moved = -1.0;
  const auto& decks = terrain->decks();
  for (std::size_t k = 0; k < decks.size(); ++k) {
    NearbyDeck near{static_cast<int>(k), {}, 0.0};
    if (decks[k]->body == slot.body || !is_near(*decks[k], bounds, slot.linear, time, duration, near)) continue;
    moved = std::max(moved, near.moved);
    slot.decks.push_back(near);
  }
  return moved;
}

void BulletWorld::find_deck_contacts(const Slot& slot, const Convex& shape, const Pose& pose, double step) {
  Approach body = approach_of(slot, step);
  body.linear = slot.linear, body.ground = {};
  const auto& decks = terrain->decks();
  for (const NearbyDeck& near : slot.decks)  // a sleeping body may know decks that are gone
    if (near.number < static_cast<int>(decks.size()))
      deck_search_.add(shape, pose, *decks[near.number], near, time, body, on_decks_, seams_);
}

// Lets contacts yield as their carriers do. Contacts of a body with one deck share their load.
void BulletWorld::let_decks_yield() {
  for (Contact& contact : contacts_) {
    if (contact.deck < 0 || carried_[contact.deck].object == nullptr) continue;
    const auto shares =
        std::count_if(contacts_.begin(), contacts_.end(), [&](const Contact& c) { return c.deck == contact.deck; });
    contact.yields =
        yield_of(*carried_[contact.deck].object, contact.point, contact.normal) * static_cast<double>(shares);
  }
}

// The carriers of decks take the impulses of the step on what is on the decks, at the end of the step.
void BulletWorld::react() {
  for (Carried& carried : carried_) {
    if (carried.object == nullptr || carried.object->isStaticOrKinematicObject()) continue;
    const FrameVelocity end = velocity_of(*carried.object);
    const double rate = 1.0 / duration;
    const FrameVelocity change{(end.linear - carried.start.linear) * rate,
                               (end.angular - carried.start.angular) * rate};
    carried.change = agreed(change, carried.last);
    carried.last = change;
  }
  for (const TruePoint& told : told_) {
    if (told.deck < 0 || carried_[told.deck].object == nullptr) continue;
    btCollisionObject& object = *carried_[told.deck].object;
    if (object.isStaticOrKinematicObject()) continue;
    const btManifoldPoint& point = *told.point;
    const btVector3 on_a = point.m_normalWorldOnB * point.m_appliedImpulse +
                           point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                           point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
    const Vec3 at = from_bullet(told.ground_is_b ? told.on_b : told.on_a);
    if (on_a.fuzzyZero()) continue;
    const int body = name_of(object).body;
    if (body >= 0) wake_body(body);
    object.activate();
    push(object, at, from_bullet(told.ground_is_b ? -on_a : on_a), duration);
  }
  move_carried();
}

bool BulletWorld::is_on_carrier(const Slot& slot) const {
  return std::any_of(slot.decks.begin(), slot.decks.end(), [&](const NearbyDeck& near) {
    const btCollisionObject* carrier =
        near.number < static_cast<int>(carried_.size()) ? carried_[near.number].object : nullptr;
    return carrier != nullptr && !carrier->isStaticOrKinematicObject();
  });
}

}  // namespace smartmesh
