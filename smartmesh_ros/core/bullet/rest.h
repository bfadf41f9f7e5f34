// What is known of bodies at rest: for how long they are still, and what a sleeping one fell asleep on.
#pragma once

#include <optional>
#include <vector>

#include "bullet/objects.h"
#include "ground/ground_under.h"

namespace smartmesh {

// When bodies fall asleep and wake, as SleepConfig in ground/config.py. `after` [s]: on Earth; infinity = nobody
// sleeps.
struct SleepRules {
  double after = INFINITE;
  double distance = 1e-3;                  // [m]
  double joint = 0.02;                     // [rad/s, m/s]
  Tolerance tolerance{2.5e-4, 3.0, 5e-3};  // of changes of the ground
};

// Rest of a body or link. Asleep it has a `pose`, and `bounds` with the `ground` under them, in `blocks` of a `layout`
// of tiles with so many `updates`; if the ground is not `calm` it may be another one without an update.
struct Rest {
  bool asleep = false;
  btTransform pose;
  Bounds bounds;
  GroundUnder ground;
  std::vector<BlockUnder> blocks;
  std::int64_t updates = -1;
  long layout = -1;
  bool calm = false;
  double corrected = 0.0;  // by how much the ground under it was corrected since, on average [m]
  int samples = 0;         // that say so
  double raised = 0.0;     // in this step [m]
  double radius = 0.0;     // bounding radius about the centre of mass [m]
};

// Whether PyBullet lets a body sleep by its own rule.
struct Activation {
  int state = ACTIVE_TAG;
  bool can_sleep = false, can_wake = true;
};

// A PyBullet body, which may be a robot with several attached links, that was put to sleep or sleeps: what it was
// `before` it was put to sleep, the targets of its `motors`, and how far it followed corrections of the ground asleep
// [m].
struct Sleeper {
  std::optional<Activation> before;
  std::vector<double> motors;
  double followed = 0.0;
};

inline bool sleeps(const btCollisionObject& object) { return object.getActivationState() == ISLAND_SLEEPING; }

// Returns true if somebody pushes an awake body beside gravity in the coming step, or drives its joints to move.
bool is_acted_on(btCollisionObject& object, const btVector3& gravity);
// Returns true if no joint of a body is faster than `fastest` [rad/s, m/s].
bool joints_rest(btCollisionObject& object, double fastest);
// Returns true if a sleeping body was given a velocity or a force.
bool is_pushed(btCollisionObject& object);
// Returns the targets and the strengths of the motors of a robot's joints, of other bodies none.
std::vector<double> motors_of(btCollisionObject& object);

// Asks PyBullet to put a body to sleep with its island, and returns what it was before; wakes it as what it was before.
Activation let_sleep(btCollisionObject& object);
void rouse(btCollisionObject& object, const std::optional<Activation>& before, const btVector3& gravity);
// Gives a body the weight that Bullet gave to awake ones before the step.
void add_weight(btCollisionObject& object, const btVector3& gravity);
// Forgets forces that Bullet left on a robot that fell asleep.
void forget_forces(btCollisionObject& object);
// Moves a sleeping body, or a robot with all its links, up [m].
void lift(btCollisionObject& object, double by);

}  // namespace smartmesh
