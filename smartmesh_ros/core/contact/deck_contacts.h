// Contacts of a shape with all ground: those with decks are found in the frames of the decks, and told in the world.
#pragma once

#include <vector>

#include "contact/seams.h"
#include "ground/deck.h"

namespace smartmesh {

// A deck that a body may touch in a step: its number, its ground near the body, in the deck's frame, how far that
// ground moves in the step [m], and its velocity in the world [m/s].
struct NearbyDeck {
  int number;
  NearbyGround ground;
  double moved;
  Vec3 velocity{};
};

// Returns true if a body inside some bounds, which move at a `velocity` [m/s], may touch a deck in a step that takes
// `duration` [s].
bool is_near(Deck& deck, const Bounds& bounds, const Vec3& velocity, double time, double duration, NearbyDeck& found);

// Returns all decks but those that a PyBullet `body` carries, as they are to a body at rest.
std::vector<NearbyDeck> all_decks(const Tiles& tiles, int body = NOBODY);

class GroundContacts {
 public:
  // Finds the contacts of a shape at `pose` with some decks of the tiles at `time` [s]. `body`: motion of the body
  // relative to the world.
  void find_on_decks(const Convex& shape, const Pose& pose, const Tiles& tiles, const std::vector<NearbyDeck>& decks,
                     double time, const Approach& body);
  bool has_decks() const { return !on_decks_.empty(); }
  // Replaces `contacts` by those of the shape with the other ground, see ContactSearch, and those found on decks
  // before. `soil`: is left out. Rotations of the other ground are found for those contacts alone that are chosen of
  // them.
  void find(const Convex& shape, const Pose& pose, Tiles& tiles, double time, const Approach& approach,
            std::vector<Contact>& contacts, const SoilBelow& soil = {});
  void find_rotations(std::vector<Contact>& contacts) const { search_.find_rotations(contacts); }

 private:
  void add(const Convex& shape, const Pose& pose, Deck& deck, const NearbyDeck& near, double time,
           const Approach& body);

  ContactSearch search_, deck_search_;
  std::vector<Contact> on_deck_, on_decks_;
  Seams seams_;
};

}  // namespace smartmesh
