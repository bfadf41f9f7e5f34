// What Python sees of contacts: those of one shape with the ground, without PyBullet; and, by the number of a client,
// what the core reads of them in Bullet's memory.
#include "bullet/contact_points.h"
#include "bullet/world.h"
#include "contact/deck_contacts.h"
#include "python/bindings.h"
#include "shape/lower_surface.h"

namespace smartmesh {
namespace {

// Point, normal, distance, and the names of both features.
using ContactNumbers = std::array<double, 9>;

double checked(double value, const char* name) {
  if (!(value >= 0.0 && value < 1e9))
    throw std::invalid_argument(std::string(name) + " must be at least zero and finite");
  return value;
}

// How a shape of one part meets the ground of some tiles. `pose` (4, 3): the rows of the rotation, then the position.
// `motion` (2, 3): linear and angular velocity relative to the ground, which is read at `time` [s].
auto find_contacts_with(const BodyShape& body, const nb::list& tiles, One<Pose, 4, 3> pose,
                        One<FrameVelocity, 2, 3> motion, double duration, double margin, double time) {
  if (body.parts.size() != 1) throw std::invalid_argument("the shape must be of one part");
  const Convex shape = convex_of(body.parts[0]);
  for (const Vec3& v : {pose->rotation.row[0], pose->rotation.row[1], pose->rotation.row[2], pose->at})
    finite(norm2(v), "a pose");
  finite(norm2(motion->linear) + norm2(motion->angular), "a motion");
  const Approach approach{motion->linear, motion->angular, pose->at, checked(duration, "the duration"),
                          checked(margin, "the margin")};
  Tiles terrain;
  set_tiles_of(terrain, tiles);
  std::vector<Contact> contacts;
  const Pose at = *pose * pose_of(body.outline);
  GroundContacts search;
  search.find_on_decks(shape, at, terrain, all_decks(terrain), finite(time, "the time"), approach);
  search.find(shape, at, terrain, time, approach, contacts);
  std::vector<ContactNumbers> found;
  for (const Contact& c : contacts)
    found.push_back({c.point.x, c.point.y, c.point.z, c.normal.x, c.normal.y, c.normal.z, c.distance,
                     static_cast<double>(c.body_feature), static_cast<double>(c.ground_feature)});
  return array_of(std::move(found));
}

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

void add_contacts(nb::module_& m) {
  m.def("find_contacts", &find_contacts_with, "shape"_a, "tiles"_a, "pose"_a, "motion"_a, "duration"_a, "margin"_a,
        "time"_a = 0.0);
  m.def(
      "solver_settings", [](int client) { return array_of(settings(client)); }, "client"_a);
  m.def(
      "contacts_of", [](int client, int slot) { return array_of(contacts(client, slot)); }, "client"_a, "slot"_a);
}

}  // namespace smartmesh
