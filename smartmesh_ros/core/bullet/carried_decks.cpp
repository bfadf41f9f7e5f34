#include "bullet/carried_decks.h"

#include <algorithm>

#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include "bullet/object_velocity.h"

namespace smartmesh {

namespace {

// The manifolds that Bullet has for one step alone: it solves them, and joins the islands of their bodies.
struct OneStep : btDiscreteDynamicsWorld {
  static auto& manifolds(btDiscreteDynamicsWorld& world) { return static_cast<OneStep&>(world).m_predictiveManifolds; }
};

}  // namespace

void CarriedDecks::find_carriers() {
  const auto& decks = now_.terrain->decks();
  const bool same =
      layout_ == now_.terrain->layout() && objects_ == attached_.searches() &&
      std::equal(carriers_.begin(), carriers_.end(), decks.begin(), [](const Carrier& known, const Deck* deck) {
        return known.body == deck->body && known.link == deck->link;
      });
  if (same) return;
  layout_ = now_.terrain->layout(), objects_ = attached_.searches();
  carriers_.clear();
  for (const Deck* deck : decks) {
    Carrier carrier{deck->body, deck->link};
    if (deck->body >= 0) carrier.object = find_object(now_.world, {deck->body, deck->link});
    carriers_.push_back(carrier);
  }
}

void CarriedDecks::move() {
  find_carriers();
  for (std::size_t k = 0; k < carriers_.size(); ++k) {
    Deck& deck = *now_.terrain->decks()[k];
    Carrier& carrier = carriers_[k];
    if (deck.body >= 0 && carrier.object == nullptr) deck.motion.stop(now_.time);
    if (carrier.object == nullptr) continue;
    const btTransform& pose = carrier.object->getWorldTransform();
    const Vec3 arm = from_bullet(pose.getBasis() * to_bullet(deck.place.at));
    const auto [at, orientation] = body_pose(pose);
    FrameSample sample{now_.time, at + arm, orientation * deck.place.orientation};
    carrier.velocity = velocity_of(*carrier.object);
    if (!carrier.is_moved() || sleeps(*carrier.object)) {
      deck.motion.note(sample);
      continue;
    }
    const FrameVelocity& velocity = carrier.velocity;
    const Vec3 swing = cross(velocity.angular, arm);
    sample.is_told = 1.0, sample.velocity = {velocity.linear + swing, velocity.angular};
    deck.motion.set(sample, {cross(velocity.angular, swing), {}});
  }
}

double CarriedDecks::find_near(Slot& slot, const Bounds& bounds) const {
  slot.decks.clear();
  double moved = -1.0;
  const auto& decks = now_.terrain->decks();
  for (std::size_t k = 0; k < decks.size(); ++k) {
    NearbyDeck near{static_cast<int>(k), {}, 0.0};
    if (decks[k]->body == slot.body || !is_near(*decks[k], bounds, slot.linear, now_.time, now_.duration, near))
      continue;
    moved = std::max(moved, near.moved);
    if (near.moved > 0.0 && !carriers_[k].is_moved()) slot.stir();
    slot.decks.push_back(near);
  }
  return moved;
}

const Carrier* CarriedDecks::carrier_of(int deck) const {
  return now_.stepping && deck >= 0 && carriers_[deck].is_moved() ? &carriers_[deck] : nullptr;
}

btPersistentManifold& CarriedDecks::manifold_with(const Carrier& carrier, const Slot& slot,
                                                  btPersistentManifold& with_proxy) {
  for (const Shared& it : shared_)
    if (it.with_proxy == &with_proxy && it.carrier == carrier.object) return *it.with_carrier;
  const bool ground_is_b = with_proxy.getBody0() == slot.object;
  const btCollisionObject *a = slot.object, *b = carrier.object;
  btPersistentManifold* manifold = now_.world.getDispatcher()->getNewManifold(ground_is_b ? a : b, ground_is_b ? b : a);
  OneStep::manifolds(now_.world).push_back(manifold);
  shared_.push_back({manifold, &with_proxy, carrier.object});
  return *manifold;
}

void CarriedDecks::end_step() {
  for (const auto& [with_carrier, with_proxy, carrier] : shared_) {
    for (int k = 0; k < with_carrier->getNumContacts(); ++k) {
      const int count = with_proxy->getNumContacts();
      with_proxy->setNumContacts(count + 1);
      with_proxy->getContactPoint(count) = with_carrier->getContactPoint(k);
    }
    OneStep::manifolds(now_.world).remove(with_carrier);
    now_.world.getDispatcher()->releaseManifold(with_carrier);
  }
  shared_.clear();
  move();
}

}  // namespace smartmesh
