// The ground in one Bullet world: a ground proxy for each attached body or link, and what happens in a step.
#pragma once

#include <exception>
#include <utility>
#include <vector>

#include "bullet/bounds_hook.h"
#include "bullet/ground_algorithm.h"
#include "bullet/narrowphase.h"
#include "bullet/sleep.h"
#include "bullet/untouchable.h"

namespace smartmesh {

class BulletWorld {
 public:
  const int number;  // among the worlds that the client has had; `resetSimulation` makes a new one
  Instant now;
  Attached attached;
  Sleep sleep;
  CarriedDecks decks;
  Narrowphase narrowphase;
  bool owned = false;  // by a ground of Python
  long rescues = 0;    // number of times that a body was put back onto the ground

  BulletWorld(btDiscreteDynamicsWorld& world, int of_number);
  BulletWorld(const BulletWorld&) = delete;

  // Returns true if this is the ground in a world, which may lie where another one was.
  bool is_in(const btDiscreteDynamicsWorld* world) const;
  // Detaches all bodies and forgets the tiles, which may go.
  void release();
  // Releases, and leaves the world for good. This object must outlive the world, whose pairs still name it.
  void leave();

  // Puts a body's link and its `proxy` (-1 = none) into an unused slot; false if PyBullet has no such objects. `shape`:
  // what lifting, corrections and falls take the link for.
  bool attach(int slot, const ObjectName& name, int proxy, const BodyShape& shape);
  void detach(int slot);
  // Notes that PyBullet removed a body.
  void note_removed(int body);
  bool is_ground(int body) const;  // a proxy, or one that is drawn and that nothing touches
  // Lets nothing touch a body from now on, which rays still meet; false if PyBullet has no such body.
  bool keep_apart(int body);
  // Moves the surface of the body in a slot, which wakes the body if it sleeps in PyBullet.
  void drive(int slot, const Belt& belt);
  // Wakes the body in a slot, if it is there.
  void wake(int slot);

  // Brings bodies and ground to the time of the next step: bodies move with corrections of maps, sleeping ones wake
  // that something disturbed, proxies are placed, and bodies that are below the ground are put back onto it.
  void update();
  // Called by Bullet's ticks: updates before a step; after it time goes on, soil is pressed, and rest is noted.
  void before_step();
  void after_step();
  // Places the proxies for a collision query between steps.
  void before_query();

  // Forgets the past: contacts and their impulses, rest, the order in which objects came near each other.
  void forget();

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
  bool has_fault() const { return fault_ != nullptr; }
  std::exception_ptr take_fault() { return std::exchange(fault_, nullptr); }

 private:
  void place_proxies();
  void place(Slot& slot);
  void lift();

  Tiles nothing_;  // the ground without tiles
  GroundAlgorithms algorithms_{this};
  UntouchableFilter untouchable_;
  BoundsHook hook_{[this] { before_query(); }};
  bool is_hooked_ = false;
  std::exception_ptr fault_;
  std::vector<int> maybe_below_;  // slots of bodies that may be below the ground
};

// Returns the world with the number that the plugin's command gave; null if its client was disconnected, or its server
// runs in another process.
BulletWorld* world_of(int client);

}  // namespace smartmesh
