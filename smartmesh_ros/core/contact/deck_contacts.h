// Contacts of a shape with a deck: found in the deck's frame, told in the world.
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

// Adds the contacts of a shape at `pose` with a deck at `time` [s], and the deck's ground there to `seams`. `body`:
// motion of the body relative to the world.
class DeckSearch {
 public:
  void add(const Convex& shape, const Pose& pose, Deck& deck, const NearbyDeck& near, double time, const Approach& body,
           std::vector<Contact>& contacts, Seams& seams);

 private:
  ContactSearch search_;
  std::vector<Contact> found_;
};

}  // namespace smartmesh
