// What Python sees of what the core reads in Bullet's memory, by the number of a client.
#include "bullet/contact_points.h"
#include "bullet/world.h"
#include "python/bindings.h"

namespace smartmesh {
namespace {

BulletWorld& world_at(int client) {
  BulletWorld* world = world_of(client);
  if (world == nullptr) throw std::invalid_argument("the PyBullet client is disconnected");
  return *world;
}

// Returns of a world's solver gravity (3) [m/s^2], the duration of the last step [s], the shares of a penetration and
// of a friction anchor's distance that a step corrects, and the penetration [m] that is left (7,).
std::vector<double> settings(int client) {
  const StepLock lock;
  btDiscreteDynamicsWorld& world = world_at(client).now.world;
  const btContactSolverInfo& solver = world.getSolverInfo();
  const btVector3 g = world.getGravity();
  return {g.x(),
          g.y(),
          g.z(),
          world.getDispatchInfo().m_timeStep,
          solver.m_erp2,
          solver.m_frictionERP,
          solver.m_linearSlop};
}

// Returns the point (3) [m], the normal impulse and the impulse of friction (3) [N s] of each contact of a slot in the
// last step (n, 7).
std::vector<std::array<double, 7>> contacts(int client, int slot) {
  std::vector<std::array<double, 7>> rows;
  std::vector<OldContact> found;
  const StepLock lock;
  BulletWorld& world = world_at(client);
  world.attached.find_objects();
  const btCollisionObject* ground = world.attached.has(slot) ? world.attached.slots[slot].ground : nullptr;
  btDispatcher& dispatcher = *world.now.world.getDispatcher();
  for (int k = 0; ground != nullptr && k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    if (manifold.getBody0() != ground && manifold.getBody1() != ground) continue;
    read_contacts(manifold, found);
    for (const OldContact& c : found)
      rows.push_back({c.point.x, c.point.y, c.point.z, c.normal_impulse, c.friction.x, c.friction.y, c.friction.z});
  }
  return rows;
}

}  // namespace

void add_probe(nb::module_& m) {
  m.def(
      "solver_settings", [](int client) { return array_of(settings(client)); }, "client"_a);
  m.def(
      "contacts_of", [](int client, int slot) { return array_of(contacts(client, slot)); }, "client"_a, "slot"_a);
}

}  // namespace smartmesh
