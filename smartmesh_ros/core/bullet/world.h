// The ground in one Bullet world: a ground proxy for each attached body or link, and its contacts.
#pragma once

#include <exception>
#include <optional>
#include <utility>
#include <vector>

#include <BulletDynamics/Dynamics/btDiscreteDynamicsWorld.h>

#include "bullet/bounds_hook.h"
#include "bullet/contact_points.h"
#include "bullet/ground_algorithm.h"
#include "bullet/server_world.h"
#include "bullet/slot.h"
#include "bullet/untouchable.h"
#include "contact/contact_search.h"

namespace smartmesh {

// PyBullet's numbers of a body and its link, -1 = the base; `body` is -1 for what PyBullet did not make.
struct ObjectName {
  int body, link;
};
ObjectName name_of(const btCollisionObject& object);
// Throws `std::invalid_argument` if a body is soft.
void require_rigid(const btCollisionObject& object);

// What the ground reads of a world's solver: `duration` [s] of the last step, shares of a penetration and of a friction
// anchor's distance that a step corrects, and the penetration [m] that is left.
struct SolverSettings {
  Vec3 gravity;
  double duration, erp, friction_erp, slop;
};

// Slots of bodies that began to fall, and of those that are lost.
struct Falls {
  std::vector<int> begun, lost;
};

class BulletWorld {
 public:
  Tiles* terrain = &nothing_;  // belongs to Python
  double time = 0.0;           // at the start of the next step [s]
  double duration = 0.0;       // of a step [s]
  double margin = 0.001;       // distance up to which contacts are found beside the motion of a step [m]

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
  btDiscreteDynamicsWorld& bullet() const { return *world_; }
  // Number of worlds that the client has had; `resetSimulation` makes a new one.
  int worlds() const { return worlds_; }

  // Puts a body's link and its `proxy` (-1 = none) into an unused slot; false if PyBullet has no such objects. `shape`:
  // what lifting, corrections and falls take the link for.
  bool attach(int slot, int body, int link, int proxy, const BodyShape& shape);
  void set_kind(int slot, const SlotKind& kind) { slots_[slot].kind = kind; }
  void detach(int slot);
  bool has(int slot) const { return slot >= 0 && slot < static_cast<int>(slots_.size()) && slots_[slot].used; }
  // Lets nothing touch a body from now on, which rays still meet; false if PyBullet has no such body.
  bool keep_apart(int body);

  // Moves the surface of the body in a slot, which wakes the body if it sleeps in PyBullet.
  void drive(int slot, const Belt& belt);

  // Wakes the body in a slot, or all that sleep. None sleeps before it has been still for the whole time of the rules.
  void wake(int slot) {
    if (slots_[slot].body >= 0) wake_body(slots_[slot].body);
  }
  void wake_all();

  // Sets when bodies fall asleep and wake, after waking all.
  void set_rules(const SleepRules& rules);
  bool is_asleep(int slot) const { return slots_[slot].rest.asleep; }
  const std::vector<int>& find_asleep() { return list_slots(), asleep_; }

  // Returns the parts of the body in a slot that came near the soil.
  const SoilParts& parts_on_soil(int slot) const { return slots_[slot].on_soil; }

  // Finds the objects of all slots; call it before `read`.
  void find_objects();
  // Notes that PyBullet made or removed a body, whose number another may get: what was attached of it is gone for good.
  void note_added() { objects_known_ = -1; }
  void note_removed(int body);
  bool has_gone() const { return gone_ > 0; }
  // Returns the slots whose bodies were removed from PyBullet, or whose proxies were and the bodies were not.
  std::vector<int> find_gone(bool of_proxies) const;
  bool is_ground(int body) const;  // a proxy, or one that is drawn and that nothing touches
  // Writes the state of the body in a slot; false if it is gone.
  bool read(int slot, BodyState& state);

  // Brings bodies and ground to the time of the next step: bodies move with corrections of maps, sleeping ones wake
  // that something disturbed, proxies are placed, and bodies that are below the ground are put back onto it.
  void update();
  // How often that was done so far.
  long rescues() const { return rescues_; }
  // Returns the slots whose bodies are below the ground, of those that are lifted out of it; and those of awake bodies
  // that are at no place or farther away than some distance [m].
  std::vector<int> find_below();
  std::vector<int> find_nowhere(double farthest) const;
  // Looks at the awake bodies of this world's own for ground over or under them at an instant [s]. A body falls that is
  // below the last ground by more than its radius, and is lost below it by more than a `depth` [m].
  Falls check_falls(double now, double depth);
  std::vector<int> find_falling() const;
  // Returns the last ground over or under the body in a slot [m], or where it was first looked at.
  Vec3 last_ground(int slot) const { return slots_[slot].last_ground; }
  // Does it before a step of the world, and what comes after it.
  void before_step();
  void after_step();
  // Places the proxies for a collision query between steps.
  void before_query();
  bool is_stepping() const { return stepping_; }
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
  bool has_fault() const { return fault_ != nullptr; }
  std::exception_ptr take_fault() { return std::exchange(fault_, nullptr); }

  // Returns true if an object is the proxy of a body.
  bool is_proxy_of(const btCollisionObject& ground, const btCollisionObject& body);
  // Finds the contacts of a body's shape with the ground of its proxy.
  void touch(const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
             btPersistentManifold& manifold, double duration);

  // Returns the deepest contact of the body in a slot with the ground beside decks now; none if it does not touch it.
  std::optional<Contact> deepest_contact(int slot);

  // What is known of the past of the body in a slot, for a saved state: of its rest and pull, and as numbers of its
  // parts on the soil. `recall_parts` returns false if they are none of this body.
  SlotMemory memory_of(int slot) const;
  std::vector<double> parts_memory(int slot) const;
  void recall(int slot, const SlotMemory& memory);
  bool recall_parts(int slot, const double* numbers, std::size_t count);
  // Forgets the past: contacts and their impulses, rest, the order in which objects came near each other.
  void forget();
  // Does what `restoreState` leaves out: inertias of rigid bodies as they are turned now.
  void take_restored();
  // For a check of the memory's layout: what is read of the solver, and of the contacts of a slot in the last step.
  SolverSettings settings() const;
  std::vector<OldContact> contacts_of(int slot);

  bool owned = false;          // by a ground of Python
  SoilInStep* soil = nullptr;  // belongs to Python; null = none

 private:
  // A slot that a PyBullet body belongs to, as the body itself or as its proxy.
  struct Role {
    int slot;
    bool is_proxy;
  };
  // What belongs to a PyBullet body. `still` [s]: time for which all its slots are.
  struct OfBody {
    std::vector<Role> roles;
    Sleeper sleeper;
    double still = 0.0;
    bool wanted = false, driven = false, supported = false;
  };
  OfBody& of_body(int body);
  void enter(btDiscreteDynamicsWorld* world);
  btCollisionObject* find(int body, int link) const;
  void list_slots();
  void read_velocity(Slot& slot) const;
  void place_proxies();
  void place(Slot& slot);
  GroundPoint ground_above_all_parts(int slot, GroundReader& reader) const;
  void move_with_corrections();
  bool is_kept_from_ground(const Slot& slot) const;
  void lift_bodies();
  void lift_body(int body, double by, const Vec3& ground);
  // Returns true for the slots that have contacts with the ground.
  std::vector<bool> find_touching();
  void find_carriers();
  void move_carried();
  double find_decks(Slot& slot, const Bounds& bounds);
  void find_deck_contacts(const Slot& slot, const Convex& shape, const Pose& pose, double step);
  void let_decks_yield();
  void react();
  // Returns true if a body is near a deck that a body carries which physics moves.
  bool is_on_carrier(const Slot& slot) const;
  void press_soil();
  // Returns the axis that the surface of a body runs about, as long as its speed [m/s].
  Vec3 belt_of(const Slot& slot) const;
  // Returns the time in which the solver's friction closes a distance [s].
  double anchor_time(double step) const;
  static void stir(const Slot& slot);
  void note_rest();
  void note_asleep(Slot& slot);
  void note_awake(Slot& slot);
  void wake_body(int body);
  void wake_in(const Bounds& bounds);
  // Wakes the sleeping bodies that something disturbed beside a contact: that are moved, pushed or driven, whose ground
  // is another one, or beside which something moved or went.
  void wake_disturbed();
  bool is_disturbed(Slot& slot);
  bool is_another_ground(Slot& slot);
  void wake_beside_others();
  void look_beside();
  void find_ways();
  void note_driven();
  void follow_corrections(OfBody& body, double least);
  void raise_contacts();
  Slot* slot_of(const btCollisionObject& ground);
  Slot* moving_slot(const OfBody& body);
  void find_joined();
  void find_supported();
  bool can_sleep(const OfBody& body) const;
  // Lets those bodies fall asleep in the next step that are still and rest on something, if their islands are then
  // still. An island keeps its contacts.
  void put_resting_to_sleep();
  bool is_attached(const btCollisionObject& object) const;
  // Returns `margin` and the way that gravity adds to the motion of a body in a step.
  double margin_in(double step) const;
  Approach approach_of(const Slot& slot, double step) const;
  const Convex* convex_of_part(Slot& slot, const btCollisionShape& shape);
  static void find_parts(Slot& slot);
  static int part_number(Slot& slot, const btCollisionShape& shape);
  // Returns the body in a slot as the soil sees it now, in a step of some duration [s].
  OnSoil on_soil(const Slot& slot, double step) const;

  WorldPlace place_;
  GroundAlgorithms algorithms_{this};
  UntouchableFilter untouchable_;
  btDiscreteDynamicsWorld* world_ = nullptr;
  int worlds_ = 0;
  std::exception_ptr fault_;
  std::vector<Slot> slots_;
  std::vector<OfBody> bodies_;  // by PyBullet's numbers
  std::vector<Contact> contacts_, on_decks_;
  std::vector<OldContact> before_;
  std::vector<ContactRow> rows_;
  std::vector<TruePoint> told_;  // in this step
  ContactSearch search_;
  DeckSearch deck_search_;
  Seams seams_;

  // What carries a deck, by PyBullet's numbers; null = nothing. `start`: of its centre of mass in this step. `last`,
  // `change`: its change in the last step [m/s^2], and as far as it agrees with the step before.
  struct Carried {
    int body = -1, link = -1;
    btCollisionObject* object = nullptr;
    FrameVelocity start, last, change;
  };
  std::vector<Carried> carried_;  // by the decks' numbers, as of a layout of the tiles
  long carried_layout_ = -1;

  // Something that attached bodies may rest on, and that is not attached or does not move by physics.
  struct Beside {
    const btCollisionObject* object;
    btTransform pose;
    Bounds bounds;
  };
  SleepRules rules_;
  std::vector<Beside> beside_;
  bool others_listed_ = false;   // since PyBullet made or removed an object
  std::vector<Bounds> vacated_;  // where sleeping bodies wake: others woke or went there, or come there
  bool stepping_ = false;        // Bullet takes a step, for which it has applied gravity
  BoundsHook hook_{[this] { before_query(); }};
  bool is_hooked_ = false;
  std::vector<const btMultiBody*> joined_;  // robots that a constraint holds to something else: its pivot may move
  long sleep_changes_ = 0;
  int objects_known_ = -1;           // number of objects when they were found last; -1 = they changed since
  std::vector<int> awake_, asleep_;  // used slots, as of a number of changes
  long listed_at_ = -1;
  int gone_ = 0;  // number of bodies of slots, and of proxies, that were removed
  bool any_raised_ = false;
  long revision_ = -1;                           // of the ground at the last look
  bool ground_stands_ = false;                   // it is that of the last look, and does not move
  int constraints_ = 0, rigid_constraints_ = 0;  // at the last look, all and those of rigid bodies
  GroundUnder ground_, next_;
  Tiles nothing_;  // the ground without tiles
  std::vector<MapCorrection> corrections_;
  std::vector<int> maybe_below_;  // slots of bodies that may be below the ground
  long rescues_ = 0;
  std::vector<int> corrected_;  // bodies on ground that may have been corrected, in a step
  btVector3 gravity_{0.0, 0.0, 0.0};
};

// Returns the world with the number that the plugin's command gave; null if its client was disconnected, or its server
// runs in another process.
BulletWorld* world_of(int number);

}  // namespace smartmesh
