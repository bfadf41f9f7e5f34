#include "bullet/carried_decks.h"

#include <algorithm>
#include <utility>

#include <BulletCollision/NarrowPhaseCollision/btManifoldPoint.h>

#include "bullet/carrier.h"

namespace smartmesh {

void CarriedDecks::find_carriers() {
  const auto& decks = now_.terrain->decks();
  const bool same =
      layout_ == now_.terrain->layout() && objects_ == attached_.searches() &&
      std::equal(carried_.begin(), carried_.end(), decks.begin(), [](const Carried& known, const Deck* deck) {
        return known.body == deck->body && known.link == deck->link;
      });
  if (same) return;
  layout_ = now_.terrain->layout(), objects_ = attached_.searches();
  const std::vector<Carried> before = std::exchange(carried_, {});
  for (const Deck* deck : decks) {
    Carried now{deck->body, deck->link};
    if (deck->body >= 0) now.object = find_object(now_.world, {deck->body, deck->link});
    for (const Carried& it : before)
      if (it.body == now.body && it.link == now.link && it.object == now.object) now = it;
    carried_.push_back(now);
  }
}

// They are accelerated as the carriers were by the last two steps, as far as these agree.
void CarriedDecks::move() {
  find_carriers();
  for (std::size_t k = 0; k < carried_.size(); ++k) {
    Deck& deck = *now_.terrain->decks()[k];
    Carried& carried = carried_[k];
    if (deck.body >= 0 && carried.object == nullptr) deck.motion.stop(now_.time);
    if (carried.object == nullptr) continue;
    const btTransform& pose = carried.object->getWorldTransform();
    const Vec3 arm = from_bullet(pose.getBasis() * to_bullet(deck.place.at));
    const auto [at, orientation] = body_pose(pose);
    FrameSample sample{now_.time, at + arm, orientation * deck.place.orientation};
    if (!carried.is_moved()) {
      deck.motion.note(sample);
      continue;
    }
    const FrameVelocity velocity = carried.start = velocity_of(*carried.object), &change = carried.change;
    const Vec3 swing = cross(velocity.angular, arm);
    sample.is_told = 1.0, sample.velocity = {velocity.linear + swing, velocity.angular};
    deck.motion.set(sample,
                    {change.linear + cross(change.angular, arm) + cross(velocity.angular, swing), change.angular});
  }
}

double CarriedDecks::find_near(Slot& slot, const Bounds& bounds) const {
  slot.decks.clear();
  slot.is_on_carrier = false;
  double moved = -1.0;
  const auto& decks = now_.terrain->decks();
  for (std::size_t k = 0; k < decks.size(); ++k) {
    NearbyDeck near{static_cast<int>(k), {}, 0.0};
    if (decks[k]->body == slot.body || !is_near(*decks[k], bounds, slot.linear, now_.time, now_.duration, near))
      continue;
    moved = std::max(moved, near.moved);
    slot.is_on_carrier |= carried_[k].is_moved();
    slot.decks.push_back(near);
  }
  return moved;
}

void CarriedDecks::let_yield(std::vector<Contact>& contacts) const {
  for (Contact& contact : contacts) {
    if (contact.deck < 0 || carried_[contact.deck].object == nullptr) continue;
    const auto shares =
        std::count_if(contacts.begin(), contacts.end(), [&](const Contact& c) { return c.deck == contact.deck; });
    contact.yields =
        yield_of(*carried_[contact.deck].object, contact.point, contact.normal) * static_cast<double>(shares);
  }
}

void CarriedDecks::react(const std::vector<TruePoint>& told) {
  const double rate = 1.0 / now_.duration;
  for (Carried& carried : carried_) {
    if (!carried.is_moved()) continue;
    const FrameVelocity change = difference(velocity_of(*carried.object), carried.start, rate);
    carried.change = agreed(change, carried.last);
    carried.last = change;
  }
  for (const TruePoint& it : told) {
    if (it.deck < 0 || !carried_[it.deck].is_moved()) continue;
    btCollisionObject& object = *carried_[it.deck].object;
    const btManifoldPoint& point = *it.point;
    const btVector3 on_a = point.m_normalWorldOnB * point.m_appliedImpulse +
                           point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                           point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
    const Vec3 at = from_bullet(it.ground_is_b ? it.on_b : it.on_a);
    if (on_a.fuzzyZero()) continue;
    if (const int body = name_of(object).body; body >= 0) sleep_.wake(body);
    object.activate();
    push(object, at, from_bullet(it.ground_is_b ? -on_a : on_a), now_.duration);
  }
  move();
}

}  // namespace smartmesh
