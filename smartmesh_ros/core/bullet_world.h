// The ground in one Bullet world: a ground proxy for each attached body or link, and its contacts.
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include "contact_search.h"
#include "ground_shape.h"
#include "manifold.h"

class btMultiBody;

namespace smartmesh {

// An attached body or link, by PyBullet's numbers, and its proxy, a body without mass.
struct Slot {
  bool used = false, enabled = true;
  int body = -1, link = -1, proxy = -1;
  btCollisionObject* object = nullptr;  // found anew in each step; null = it is gone
  btRigidBody* ground = nullptr;        // of the proxy, likewise
  std::unique_ptr<GroundShape> shape;
  Vec3 linear, angular;    // of the body [m/s], [rad/s]
  std::unordered_map<const btCollisionShape*, std::unique_ptr<Convex>> shapes;
};

class BulletWorld {
 public:
  Surface surface;
  double time = 0.0;     // at the start of the next step [s]
  double duration = 0.0; // of a step [s]
  double margin = 0.01;  // distance up to which contacts are found beside the motion of a step [m]
  bool carry_velocity = true;

  // Called by the plugin when PyBullet makes a world, at the start and at `resetSimulation`.
  void enter(btDiscreteDynamicsWorld* world);
  void leave() { world_ = nullptr; }
  bool alive() const { return world_ != nullptr; }

  // Gives a body's link its `proxy`; returns its slot, -1 if PyBullet has no such objects.
  int attach(int body, int link, int proxy);
  void detach(int slot);
  bool has(int slot) const { return slot >= 0 && slot < static_cast<int>(slots_.size()) && slots_[slot].used; }
  void enable(int slot, bool enabled);

  // Places the proxies under their bodies, before a step of the world.
  void before_step();
  void after_step();

  // Finds the contacts of a body's shape with the ground of its proxy.
  void touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground, btPersistentManifold& manifold,
             double duration);

  btCollisionObject* find(int body, int link) const;
  long touched = 0;  // pairs of shape and ground that were looked at so far
  static BulletWorld* of(const btCollisionShape* shape);

 private:
  void find_objects();
  void place(Slot& slot);
  const Convex* convex_of_part(Slot& slot, const btCollisionShape& shape);

  btDiscreteDynamicsWorld* world_ = nullptr;
  std::vector<Slot> slots_;
  std::unordered_map<const btCollisionShape*, int> slot_of_ground_;
  std::vector<Contact> contacts_;
  std::vector<OldContact> before_;
  ContactSearch search_;
};

}  // namespace smartmesh
