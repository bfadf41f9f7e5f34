// Decks in a step: those that bodies carry move with them, and their carriers take the reaction.
#pragma once

#include <vector>

#include "bullet/contact_points.h"
#include "bullet/sleep.h"

namespace smartmesh {

class CarriedDecks {
 public:
  CarriedDecks(const Instant& now, Attached& attached, Sleep& sleep) : now_(now), attached_(attached), sleep_(sleep) {}

  // Gives the decks that are carried the pose and the velocity of their carriers now.
  void move();
  // Notes the decks that the body in a slot, inside some bounds, comes near to in the step; returns by how much they
  // may move [m], negative if there is none.
  double find_near(Slot& slot, const Bounds& bounds) const;
  // Lets contacts yield as their carriers do. Contacts of a body with one deck share their load.
  void let_yield(std::vector<Contact>& contacts) const;
  // Lets carriers take the impulses of the step on what is on their decks, at the end of the step.
  void react(const std::vector<TruePoint>& told);
  void forget() { carried_.clear(), layout_ = -1; }

 private:
  // What carries a deck, by PyBullet's numbers; null = nothing. `start`: of its centre of mass in this step. `last`,
  // `change`: its change in the last step [m/s^2], and as far as it agrees with the step before.
  struct Carried {
    int body = -1, link = -1;
    btCollisionObject* object = nullptr;
    FrameVelocity start, last, change;

    // True if something carries the deck that physics moves.
    bool is_moved() const { return object != nullptr && !object->isStaticOrKinematicObject(); }
  };
  void find_carriers();

  const Instant& now_;
  Attached& attached_;
  Sleep& sleep_;
  std::vector<Carried> carried_;     // by the decks' numbers, as of a layout of the tiles
  long layout_ = -1, objects_ = -1;  // and of a search for objects
};

}  // namespace smartmesh
