// Sleep of attached bodies. Bullet puts islands to sleep, which keep their contacts, and wakes an island in the step in
// which something awake comes near. Here is which bodies are still, and what wakes them beside that.
#pragma once

#include <vector>

#include "bullet/attached.h"
#include "bullet/instant.h"

class btMultiBody;

namespace smartmesh {

class Sleep {
 public:
  Sleep(const Instant& now, Attached& attached) : now_(now), attached_(attached) {}

  // Sets when bodies fall asleep and wake, after waking all.
  void set_rules(const SleepRules& rules);
  // Wakes a PyBullet body, or all that sleep. None sleeps before it has been still for the whole time of the rules.
  void wake(int body);
  void wake_all();
  // Wakes the sleeping bodies that something disturbed beside a contact: that are moved, pushed or driven, whose ground
  // is another one, or beside which something moved or went.
  void wake_disturbed();
  // Counts how long bodies are still, notes which of them Bullet put to sleep in the step, and lets those fall asleep
  // in the next one that are still and rest on something, if their islands are then still.
  void note_rest();
  // Notes that the body in a slot no longer sleeps.
  void note_awake(Slot& slot);
  // Takes gravity as it is: another one wakes all.
  void take_gravity() { gravity_ = now_.world.getGravity(); }
  // Forgets what was seen of the ground and of what lies beside sleeping bodies.
  void forget();

 private:
  // Something that attached bodies may rest on, and that is not attached or does not move by physics.
  struct Beside {
    const btCollisionObject* object;
    btTransform pose;
    Bounds bounds;
  };

  void note_asleep(Slot& slot);
  void note_driven();
  void find_joined();
  void find_supported();
  bool can_sleep(const AttachedBody& body);
  void put_resting_to_sleep();
  void wake_in(const Bounds& bounds);
  bool is_disturbed(Slot& slot);
  bool is_another_ground(Slot& slot);
  void wake_beside_others();
  void look_beside();
  void find_ways();
  void follow_corrections(AttachedBody& body, double least);
  void raise_contacts();

  const Instant& now_;
  Attached& attached_;
  SleepRules rules_;
  std::vector<Beside> beside_;
  long beside_of_ = -1;                          // the search for objects that it is of; -1 = none
  std::vector<Bounds> vacated_;                  // where sleeping bodies wake: others woke or went there, or come there
  std::vector<const btMultiBody*> joined_;       // robots that a constraint holds to something else: its pivot may move
  int constraints_ = 0, rigid_constraints_ = 0;  // at the last look, all and those of rigid bodies
  btVector3 gravity_{0.0, 0.0, 0.0};
  long revision_ = -1;          // of the ground at the last look
  bool ground_stands_ = false;  // it is that of the last look, and does not move
  GroundUnder ground_, next_;
  std::vector<int> corrected_;  // bodies on ground that may have been corrected, in a step
  bool any_raised_ = false;
};

}  // namespace smartmesh
