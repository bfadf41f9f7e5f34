// Contacts in Bullet's manifolds.
#pragma once

#include <vector>

#include <LinearMath/btVector3.h>

#include "contact/contact_row.h"
#include "ground/frame_motion.h"

class btCollisionObject;
class btManifoldPoint;
class btPersistentManifold;

namespace smartmesh {

// Reads the contacts of the last step and their impulses.
void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before);

// Returns what Bullet knows of a body's surface on its ground.
BodySurface surface_of(const btCollisionObject& body, const btCollisionObject& ground);

// A body and its ground in a step: its proxy, or what carries the deck that it is on. `motion`: of that object's
// centre, as the solver finds it. `duration` [s]; `slop` [m]: depth that the solver leaves; `anchor_time` [s]: in which
// the solver's friction closes a distance.
struct Touching {
  const btCollisionObject &body, &ground;
  FrameVelocity motion;
  bool ground_is_b;
  double duration, slop, anchor_time;
};

// What is true of a point, where the solver was told otherwise to do the right thing.
struct TruePoint {
  btManifoldPoint* point;
  double distance;
  btVector3 on_a, on_b;
};

// Adds a contact to a manifold, with what the solver has to bring about: along the normal by the distance of the point;
// along the ground by its desired motion, or by an anchor of friction for solvers that read no motion. `old`: the
// contact in the last step, whose impulse goes on; null = there was none. Returns what is true of the point.
TruePoint add_contact(const Contact& contact, const ContactRow& row, const OldContact* old, const Touching& touching,
                      btPersistentManifold& manifold);

}  // namespace smartmesh
