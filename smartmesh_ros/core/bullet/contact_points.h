// Contacts in Bullet's manifolds.
#pragma once

#include <vector>

#include "manifold.h"

class btManifoldPoint;
class btPersistentManifold;
struct btCollisionObjectWrapper;

namespace smartmesh {

// Reads the contacts of the last step and their impulses.
void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before);

// A body and its ground. `erp`: share of a penetration that the solver corrects in a step. `belt`: axis that the body's
// surface runs about, as long as its speed [m/s]. `anchor_time` [s]: in which the solver's friction closes a distance.
// `softness` [s/kg]: of contacts that share a load; zero = rigid.
struct Touching {
  const btCollisionObjectWrapper &body, &ground;
  const Approach& approach;
  double erp;
  Vec3 belt{};
  double anchor_time = 0.0;
  double softness = 0.0;
};

// Puts contacts into a manifold in place of those of the last step, whose impulses go on.
void write_contacts(const std::vector<Contact>& contacts, const std::vector<OldContact>& before,
                    const Touching& touching, btPersistentManifold& manifold);

// Returns the velocity [m/s] at which a body with a belt moves where the ground touches it without slip.
Vec3 surface_velocity(const Vec3& belt, const Vec3& normal);

// Lets friction move a body `ahead` on the ground, at the velocity at which it closes this distance [m].
void run_on(const Vec3& ahead, bool ground_is_b, btManifoldPoint& point);

// Gives the contacts of a body with a belt their places on the ground again, which `write_contacts` moved for the solver.
void put_back_places(btPersistentManifold& manifold, bool ground_is_b);

}  // namespace smartmesh
