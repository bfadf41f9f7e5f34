// Contacts in Bullet's manifolds.
#pragma once

#include <vector>

#include "manifold.h"

class btPersistentManifold;
struct btCollisionObjectWrapper;

namespace smartmesh {

// Reads the contacts of the last step and their impulses.
void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before);

// Puts contacts into a manifold of `body` and `ground` in place of those of the last step, whose impulses go on.
void write_contacts(const std::vector<Contact>& contacts, const std::vector<OldContact>& before,
                    const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
                    const Approach& approach, btPersistentManifold& manifold);

}  // namespace smartmesh
