// The bodies and links that are attached to the ground in a Bullet world.
#pragma once

#include <cstdint>
#include <vector>

#include "bullet/slot.h"

namespace smartmesh {

class FrictionAxes;

// What belongs to a PyBullet body: the `slots` of its attached links, and the slot that it is the proxy of, -1 = none.
// `still` [s]: time for which all its slots are. `driven`: somebody pushes it or drives its joints. `supported`:
// something else bore it in the last step. `friction`: of a robot whose links are attached; null of other bodies.
struct AttachedBody {
  std::vector<int> slots;
  int proxy_of = -1;
  Sleeper sleeper;
  double still = 0.0;
  bool driven = false, supported = false;
  FrictionAxes* friction = nullptr;
};

// An attached body as a row of numbers: position [m], NaN = it is gone, velocity [m/s] and bounding radius [m]. 1 =
// this world moves it (`own`), another node simulates it (`remote`), or it collides (`solid`); otherwise 0.
struct AttachedRow {
  Vec3 at{NONE, NONE, NONE}, velocity;
  double radius = 0.0, own = 0.0, remote = 0.0, solid = 0.0;
};

class Attached {
 public:
  explicit Attached(btDiscreteDynamicsWorld& world) : world_(world) {}

  std::vector<Slot> slots;
  std::vector<AttachedBody> bodies;  // by PyBullet's numbers
  std::vector<int> awake, asleep;    // slots in use, as of `list`

  bool has(std::int64_t slot) const {
    return slot >= 0 && slot < static_cast<std::int64_t>(slots.size()) && slots[slot].used;
  }
  // Returns what belongs to a PyBullet body, making it if needed; and true if links of it are attached.
  AttachedBody& body(int number);
  bool has_body(int number) const;
  // Returns the slot of a ground proxy; null of other objects.
  Slot* slot_of(const btCollisionObject& proxy);
  // Returns the first link of a body that physics moves; null if there is none.
  Slot* moving_slot(const AttachedBody& body);

  // Finds the objects of all slots, if PyBullet made or removed any since.
  void find_objects();
  void note_change() { known_ = -1, ++rest_changes_; }
  // Number of times that the objects were found.
  long searches() const { return searches_; }
  // Notes that PyBullet removed a body, whose number another may get: what was attached of it is gone for good.
  void note_removed(int number);
  bool has_gone() const { return gone_ > 0; }
  // Returns the slots for which `holds(slot)` is true.
  template <class Holds>
  std::vector<int> where(const Holds& holds) const {
    std::vector<int> found;
    for (std::size_t k = 0; k < slots.size(); ++k)
      if (holds(slots[k])) found.push_back(static_cast<int>(k));
    return found;
  }
  // Returns the slots whose bodies were removed from PyBullet, or whose proxies were and the bodies were not.
  std::vector<int> find_gone(bool of_proxies) const;
  // Returns the bodies by slot.
  std::vector<AttachedRow> rows();
  // Takes a slot out of use.
  void remove(int slot);

  // Lists the slots by whether their bodies sleep.
  void list();
  const std::vector<int>& list_asleep() { return list(), asleep; }
  void note_rest_change() { ++rest_changes_; }

 private:
  btDiscreteDynamicsWorld& world_;
  int known_ = -1;  // number of objects when they were found last; -1 = they changed since
  long searches_ = 0;
  int gone_ = 0;  // number of bodies of slots, and of proxies, that were removed
  long rest_changes_ = 0, listed_at_ = -1;
};

}  // namespace smartmesh
