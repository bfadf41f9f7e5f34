// Contacts in Bullet's manifolds.
#pragma once

#include <vector>

#include <LinearMath/btVector3.h>

#include "contact/contact_row.h"

class btCollisionObject;
class btManifoldPoint;
class btPersistentManifold;
class btRigidBody;

namespace smartmesh {

// Reads the contacts of the last step and their impulses.
void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before);

// Returns what Bullet knows of a body's surface on its ground.
BodySurface surface_of(const btCollisionObject& body, const btCollisionObject& ground);

// A body and its ground proxy in a step. `duration` [s]; `slop` [m]: depth that the solver leaves; `anchor_time` [s]:
// in which the solver's friction closes a distance.
struct Touching {
  const btCollisionObject& body;
  const btRigidBody& ground;
  bool ground_is_b;
  double duration, slop, anchor_time;
};

// What is true of a point, where the solver was told otherwise to do the right thing. `deck`: as in Contact.
struct TruePoint {
  btManifoldPoint* point;
  double distance;
  btVector3 on_a, on_b;
  bool ground_is_b;
  int deck;
};

// Puts contacts into a manifold in place of those of the last step, whose impulses go on, with what the solver has to
// bring about: along the normal by the distance of a point; along the ground by its desired motion, or by an anchor of
// friction for solvers that read no motion. `told`: takes what is true of the points.
void write_contacts(const std::vector<Contact>& contacts, const std::vector<ContactRow>& rows,
                    const std::vector<OldContact>& before, const Touching& touching, btPersistentManifold& manifold,
                    std::vector<TruePoint>& told);

}  // namespace smartmesh
