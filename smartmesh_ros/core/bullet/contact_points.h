// Contacts in Bullet's manifolds.
#pragma once

#include <vector>

#include "manifold.h"

class btPersistentManifold;
struct btCollisionObjectWrapper;

namespace smartmesh {

// Reads the contacts of the last step and their impulses.
void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before);

// A body and its ground. `erp`: share of a penetration that the solver corrects in a step. `softness` [s/kg]: of contacts
// that share a load; zero = rigid.
struct Touching {
  const btCollisionObjectWrapper &body, &ground;
  const Approach& approach;
  double erp, softness;
};

// Puts contacts into a manifold in place of those of the last step, whose impulses go on.
void write_contacts(const std::vector<Contact>& contacts, const std::vector<OldContact>& before,
                    const Touching& touching, btPersistentManifold& manifold);

}  // namespace smartmesh
