// What Python sees of what the core reads in Bullet's memory, by the number of a client.
#include "bullet/world.h"
#include "bullet/world_probe.h"
#include "python/tables.h"

namespace smartmesh {
namespace {

BulletWorld& world_at(int client) {
  BulletWorld* world = world_of(client);
  if (world == nullptr) throw std::invalid_argument("the PyBullet client is disconnected");
  return *world;
}

// Returns gravity (3) [m/s^2], duration [s], erp, friction erp and slop [m] of the world's solver (7,).
auto settings(int client) {
  const StepLock lock;
  const SolverSettings found = settings_of(world_at(client).now.world);
  const Vec3& g = found.gravity;
  return array_of<double, 1>({g.x, g.y, g.z, found.duration, found.erp, found.friction_erp, found.slop}, {7});
}

// Returns the point (3) [m], the normal impulse and the impulse of friction (3) [N s] of each contact of a slot in the
// last step (n, 7).
auto contacts(int client, int slot) {
  std::vector<double> rows;
  const StepLock lock;
  BulletWorld& world = world_at(client);
  world.attached.find_objects();
  if (world.attached.has(slot) && world.attached.slots[slot].ground != nullptr)
    for (const OldContact& c : contacts_of(world.now.world, *world.attached.slots[slot].ground))
      rows.insert(rows.end(),
                  {c.point.x, c.point.y, c.point.z, c.normal_impulse, c.friction.x, c.friction.y, c.friction.z});
  return array_of<double, 2>(rows, {rows.size() / 7, 7});
}

}  // namespace

void add_probe(nb::module_& m) {
  m.def("solver_settings", &settings, "client"_a);
  m.def("contacts_of", &contacts, "client"_a, "slot"_a);
}

}  // namespace smartmesh
