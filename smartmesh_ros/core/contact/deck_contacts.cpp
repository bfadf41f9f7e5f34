#include "contact/deck_contacts.h"

namespace smartmesh {

namespace {

// Spreads the names of the features of decks, so that those of two decks differ.
constexpr unsigned SPREAD = 0x9e3779b1u;

// Returns the motion of a body relative to a deck, in the deck's frame.
Approach seen_from(const FrameState& frame, const NearbyGround& near, const Approach& body) {
  Approach local = body.with_margin(near.spread * body.duration);
  const Mat3& rotation = frame.pose.rotation;
  local.centre = frame.pose.to_local(body.centre);
  local.ground = near.velocity;
  local.gravity = transposed(rotation, body.gravity);
  local.linear = transposed(rotation, body.linear - frame.velocity_at(body.centre)) - near.velocity;
  local.angular = transposed(rotation, body.angular - frame.velocity.angular);
  return local;
}

}  // namespace

bool is_near(Deck& deck, const Bounds& bounds, const Vec3& velocity, double time, double duration, NearbyDeck& found) {
  const FrameState frame = deck.motion.at(time);
  const Bounds swept = bounds.swept(velocity * duration);
  const Vec3 middle = (swept.low + swept.high) * 0.5, carried = frame.velocity_at(middle);
  const double turns = norm(frame.velocity.angular) * norm(swept.high - middle) * duration;
  const Bounds local = Deck::local_bounds(frame.pose, bounds.swept((velocity - carried) * duration).grown(turns));
  found.ground = deck.tiles.near(local, time, duration);
  const double moves = (norm(found.ground.velocity) + found.ground.spread) * duration;
  found.velocity = carried + frame.pose.rotation * found.ground.velocity;
  found.moved = norm(carried) * duration + turns + moves;
  return found.ground.highest >= local.low.z - moves;
}

std::vector<NearbyDeck> all_decks(const Tiles& tiles, int body) {
  std::vector<NearbyDeck> found;
  for (std::size_t k = 0; k < tiles.decks().size(); ++k)
    if (tiles.decks()[k]->body != body) found.push_back({static_cast<int>(k), {}, 0.0});
  return found;
}

void GroundContacts::find_on_decks(const Convex& shape, const Pose& pose, const Tiles& tiles,
                                   const std::vector<NearbyDeck>& decks, double time, const Approach& body) {
  on_decks_.clear(), seams_.clear();
  for (const NearbyDeck& near : decks)  // a sleeping body may know decks that are gone
    if (near.number < static_cast<int>(tiles.decks().size()))
      add(shape, pose, *tiles.decks()[near.number], near, time, body);
}

void GroundContacts::find(const Convex& shape, const Pose& pose, Tiles& tiles, double time, const Approach& approach,
                          std::vector<Contact>& contacts, const SoilBelow& soil) {
  search_.run(shape, pose, tiles, time, approach, contacts, INFINITE, soil);
  contacts.insert(contacts.end(), on_decks_.begin(), on_decks_.end());
  seams_.remove_hidden(search_, pose.to_world(shape.centre), contacts);
}

// Adds the contacts with a deck, and its ground there to the seams.
void GroundContacts::add(const Convex& shape, const Pose& pose, Deck& deck, const NearbyDeck& near, double time,
                         const Approach& body) {
  const FrameState frame = deck.motion.at(time);
  const Pose local = smartmesh::seen_from(frame.pose, pose);
  if (deck.is_above(local.to_world(shape.centre), time)) return;
  deck_search_.run(shape, local, deck.tiles, time, seen_from(frame, near.ground, body), on_deck_, deck.thickness);
  seams_.add(deck_search_, frame.pose);
  if (on_deck_.empty()) return;
  deck_search_.find_rotations(on_deck_);
  // Where the deck is at the end of the step: a point of it moves along a chord.
  const Pose end = deck.motion.at(time + body.ahead).pose;
  const bool has_material = deck.tiles.has_material();
  for (Contact contact : on_deck_) {
    if (contact.distance < -deck.thickness) continue;
    const Vec3 p = contact.point;
    if (has_material) contact.material = deck.tiles.material(p.x, p.y, time);
    contact.point = frame.pose.to_world(p);
    for (Vec3* way : {&contact.normal, &contact.body_edge, &contact.ground_edge, &contact.ground_turn})
      *way = frame.pose.rotation * *way;
    contact.deck = near.number;
    contact.ground_feature ^= static_cast<int>(SPREAD * (near.number + 1u));
    if (body.ahead > 0.0) {
      const Vec3 chord = (end.to_world(p) - contact.point) * (1.0 / body.ahead);
      contact.ground.velocity = chord + end.rotation * contact.ground.velocity;
      contact.ground.angular = frame.velocity.angular + frame.pose.rotation * contact.ground.angular;
      contact.ground_turn = contact.ground_turn + cross(frame.velocity.angular, contact.ground_edge);
    }
    on_decks_.push_back(contact);
  }
}

}  // namespace smartmesh
