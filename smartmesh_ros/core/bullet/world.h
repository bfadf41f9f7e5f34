// The ground in one Bullet world: a ground proxy for each attached body or link, and its contacts.
#pragma once

#include <exception>
#include <memory>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include "contact_search.h"
#include "ground_algorithm.h"
#include "ground_shape.h"
#include "manifold.h"
#include "server_world.h"
#include "soil_in_step.h"
#include "solid.h"
#include "untouchable.h"

class btMultiBody;

namespace smartmesh {

// Motion of a link's surface, as of a track: where the ground touches it with a normal n, the surface moves along
// n x axis, at a speed [m/s]. A positive speed drives the link as a wheel that turns about `axis`, which is given in the
// frame of the link's centre of mass.
struct Belt {
  Vec3 axis;
  double speed = 0.0;
};

// An attached body or link, by PyBullet's numbers, and its proxy, a body without mass.
struct Slot {
  bool used = false, enabled = true;
  bool held = false;  // its body sleeps until somebody else wakes it, whatever the ground does
  int body = -1, link = -1;
  int proxy = -1;                       // -1 = the body is only read
  btCollisionObject* object = nullptr;  // found anew in each step; null = it is gone
  btRigidBody* ground = nullptr;        // of the proxy, likewise
  btCollisionShape* shape_before = nullptr;  // of the proxy
  std::unique_ptr<GroundShape> shape;
  Vec3 linear, angular;    // of the body [m/s], [rad/s]
  Belt belt;
  std::vector<double> slept_on;  // the ground under a body that PyBullet put to sleep, as of `Surface::ground_under`
  long slept_at = -1;            // revision of the ground when it was read
  std::unordered_map<const btCollisionShape*, std::optional<Convex>> shapes;  // none = of unknown kind
  SoilParts on_soil;  // by their shapes
};

// What the ground reads of a world's solver: `duration` [s] of the last step, shares of a penetration and of a friction
// anchor's distance that a step corrects, and the penetration [m] that is left.
struct SolverSettings {
  Vec3 gravity;
  double duration, erp, friction_erp, slop;
};

class BulletWorld {
 public:
  Surface surface;
  double time = 0.0;     // at the start of the next step [s]
  double duration = 0.0; // of a step [s]
  double margin = 0.001;  // distance up to which contacts are found beside the motion of a step [m]
  bool carry_velocity = true;

  // Finds its Bullet world at a `place` of the server's memory.
  explicit BulletWorld(WorldPlace place);
  BulletWorld(const BulletWorld&) = delete;

  // Takes the world that the server has now. Call it before anything else that is done from outside.
  void look();
  // Leaves the world for good. False if the world lives on, whose pairs then still name this object.
  bool leave();
  // Detaches all bodies and forgets the tiles, which may go.
  void release();
  bool alive() const { return world_ != nullptr; }
  // Number of worlds that the client has had; `resetSimulation` makes a new one.
  int worlds() const { return worlds_; }

  // Puts a body's link and its `proxy` (-1 = none) into an unused slot; false if PyBullet has no such objects.
  bool attach(int slot, int body, int link, int proxy);
  void detach(int slot);
  bool has(int slot) const { return slot >= 0 && slot < static_cast<int>(slots_.size()) && slots_[slot].used; }
  // Switches the ground of a slot on or off; call `find_objects` before.
  void enable(int slot, bool enabled);
  // Sets whether a body that sleeps in PyBullet is left to sleep when its ground changes.
  void hold(int slot, bool held) { slots_[slot].held = held; }

  // Lets nothing touch a body from now on, which rays still meet; false if PyBullet has no such body.
  bool keep_apart(int body);

  // Moves the surface of the body in a slot, which wakes the body if it sleeps in PyBullet.
  void drive(int slot, const Belt& belt);

  // Wakes the bodies that sleep in PyBullet, and whose ground is switched on.
  void wake_all();

  // Returns the parts of the body in a slot that came near the soil.
  const SoilParts& parts_on_soil(int slot) const { return slots_[slot].on_soil; }

  // Finds the objects of all slots; call it before `read`.
  void find_objects();
  // Writes the state of the body in a slot; false if it is gone.
  bool read(int slot, BodyState& state);

  // Places the proxies under their bodies, before a step of the world.
  void before_step();
  void after_step();
  bool stepping = false;  // true from before to after a step
  bool drawn = false;  // rays meet other bodies that stand for the ground

  // Runs what Bullet calls. An exception must not pass through PyBullet: it is kept for `take_fault`.
  template <class Action>
  void guarded(Action&& action) noexcept {
    try {
      action();
    } catch (...) {
      fault_ = std::current_exception();
    }
  }
  // Returns the last exception since the call before; null if there was none.
  std::exception_ptr take_fault() { return std::exchange(fault_, nullptr); }

  // Finds the contacts of a body's shape with the ground of its proxy.
  void touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground, btPersistentManifold& manifold,
             double duration);

  // For a check of the memory's layout: what is read of the solver, and of the contacts of a slot in the last step.
  SolverSettings settings() const;
  std::vector<OldContact> contacts_of(int slot);

  bool owned = false;    // by a ground of Python
  SoilInStep* soil = nullptr;  // belongs to Python; null = none

 private:
  // A slot that a PyBullet body belongs to, as the body itself or as its proxy.
  struct Role {
    int slot;
    bool is_proxy;
  };
  void enter(btDiscreteDynamicsWorld* world);
  std::vector<Role>& roles_of(int body);
  btCollisionObject* find(int body, int link) const;
  void read_velocity(Slot& slot) const;
  void place(Slot& slot);
  void press_soil();
  // Returns the axis that the surface of a body runs about, as long as its speed [m/s].
  Vec3 belt_of(const Slot& slot) const;
  // Returns the time in which the solver's friction closes a distance [s].
  double anchor_time(double step) const;
  static void wake(const Slot& slot);
  // Returns true for the ground of a body whose surface moves.
  bool is_driven(const btCollisionObject& ground) const;
  bool keeps_asleep(Slot& slot, const btVector3& low, const btVector3& high);
  // Returns `margin` and the way that gravity adds to the motion of a body in a step.
  double margin_in(double step) const;
  Approach approach_of(const Slot& slot) const;
  const Convex* convex_of_part(Slot& slot, const btCollisionShape& shape);
  // Returns the body in a slot as the soil sees it now, in a step of some duration [s].
  OnSoil on_soil(const Slot& slot, double step) const;

  WorldPlace place_;
  GroundAlgorithms algorithms_{this};
  UntouchableFilter untouchable_;
  btDiscreteDynamicsWorld* world_ = nullptr;
  int worlds_ = 0;
  std::exception_ptr fault_;
  std::vector<Slot> slots_;
  std::vector<std::vector<Role>> roles_;  // by PyBullet body
  std::unordered_map<const btCollisionShape*, int> slot_of_ground_;
  std::vector<Contact> contacts_;
  std::vector<OldContact> before_;
  ContactSearch search_;
};

// Returns the world with the number that the plugin's command gave; null if its client was disconnected, or its server runs
// in another process.
BulletWorld* world_of(int number);

}  // namespace smartmesh
