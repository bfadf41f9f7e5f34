// Contacts of a shape with a deck: found in the deck's frame, told in the world.
#pragma once

#include <vector>

#include "contact/seams.h"
#include "ground/deck.h"

namespace smartmesh {

// A deck that a body may touch in a step: its number, its ground near the body, in the deck's frame, and how far that
// ground moves in the step [m].
struct NearbyDeck {
  int number;
  NearbyGround ground;
  double moved;
};

// Returns true if a body that stays inside `swept` in a step, which takes `duration` [s], may touch a deck.
bool is_near(Deck& deck, const Bounds& swept, double time, double duration, NearbyDeck& found);

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
