// Decks in a step: those that bodies carry move with them, and what is on such a deck touches its carrier.
#pragma once

#include "bullet/attached.h"
#include "bullet/contact_points.h"
#include "bullet/instant.h"

namespace smartmesh {

// What carries a deck, by PyBullet's numbers, and its velocity at the start of the step; null = nothing.
struct Carrier {
  int body = -1, link = -1;
  btCollisionObject* object = nullptr;
  FrameVelocity velocity;

  // True if something carries the deck that physics moves.
  bool is_moved() const { return object != nullptr && !object->isStaticOrKinematicObject(); }
};

class CarriedDecks {
 public:
  CarriedDecks(const Instant& now, const Attached& attached) : now_(now), attached_(attached) {}

  // Gives the decks that are carried the pose and the velocity of their carriers now.
  void move();
  // Notes the decks that the body in a slot, inside some bounds, comes near to in the step, and keeps it awake if one
  // moves by given poses. Returns by how much they may move [m], negative if there is none.
  double find_near(Slot& slot, const Bounds& bounds) const;

  // Returns what carries a deck in a step and is moved by physics; null if there is nothing.
  const Carrier* carrier_of(int deck) const;
  // Returns the manifold of a body and a carrier for this step, in place of the one of the body and its proxy.
  btPersistentManifold& manifold_with(const Carrier& carrier, const Slot& slot, btPersistentManifold& with_proxy);
  // Hands the contacts of the step with carriers over to the manifolds with proxies, at its end.
  void end_step();

 private:
  // The manifold that the solver has, and the one that is read between steps.
  struct Shared {
    btPersistentManifold *with_carrier, *with_proxy;
    btCollisionObject* carrier;
  };
  void find_carriers();

  const Instant& now_;
  const Attached& attached_;
  std::vector<Carrier> carriers_;    // by the decks' numbers, as of a layout of the tiles
  long layout_ = -1, objects_ = -1;  // and of a search for objects
  std::vector<Shared> shared_;       // in this step
};

}  // namespace smartmesh
