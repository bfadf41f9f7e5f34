// What is known of an attached body or link.
#pragma once

#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/ground_shape.h"
#include "bullet/rest.h"
#include "bullet/soil_in_step.h"
#include "contact/deck_contacts.h"
#include "ground/tiles.h"
#include "shape/body_shape.h"

namespace smartmesh {

// Motion of a link's surface, as of a track: where the ground touches it with a normal n, the surface moves along
// n x axis, at a speed [m/s]. A positive speed drives the link as a wheel that turns about `axis`, which is given in
// the frame of the link's centre of mass.
struct Belt {
  Vec3 axis;
  double speed = 0.0;
};

// A convex part of a body, as of its margin; without `convex` it is of unknown kind.
struct KnownPart {
  double margin;  // [m]
  std::optional<Convex> convex;
};

// `is_solid`: its body collides with the ground. `is_own`: the body is lifted out of the ground. `is_remote`: another
// node simulates it, and says whether it rests.
struct SlotKind {
  bool is_solid = false, is_own = false, is_remote = false;
};

// What a slot knows of the past, as numbers, which are saved. No point of its body has gone farther than
// SleepRules::distance from its `anchor` for the time `still` [s]. `pull`: what gravity and applied forces added to a
// rigid body's velocity in the last step [m/s]. `ground_angular`: of the ground at a contact that has rolling or
// spinning friction, in the last step [rad/s]. `last_ground`, `falls`: as of `check_falls`; z NaN = none yet.
struct SlotMemory {
  double still = 0.0;
  Pose anchor{{}, {INFINITE, 0.0, 0.0}};
  Vec3 pull, ground_angular, last_ground{0.0, 0.0, NONE};
  double falls = 0.0;
};
static_assert(sizeof(SlotMemory) == 23 * sizeof(double));

// An attached body or link, by PyBullet's numbers, and its proxy, a body without mass.
struct Slot : SlotMemory {
  bool used = false;
  SlotKind kind;
  int body = -1, link = -1;                  // `body` -1 = it was removed from PyBullet
  int proxy = -1;                            // -1 = the body is only read, or its proxy was removed
  btCollisionObject* object = nullptr;       // found anew in each step; null = it is gone
  btRigidBody* ground = nullptr;             // of the proxy, likewise
  btCollisionShape* shape_before = nullptr;  // of the proxy
  std::unique_ptr<GroundShape> shape;
  std::optional<BodyShape> body_shape;  // of each slot in use
  Vec3 linear, angular;                 // of the body, as last read [m/s], [rad/s]
  NearbyGround near;                    // in this step
  std::vector<NearbyDeck> decks;        // likewise
  bool touches = false;                 // the ground, as of the last step in which that was corrected
  Belt belt;
  Rest rest;
  std::unordered_map<const btCollisionShape*, KnownPart> parts;
  std::vector<const btCollisionShape*> leaves;  // convex parts of its shape, found when one first touches soil
  SoilParts on_soil;

  // Counts a step of `duration` [s] after which the body is at a pose.
  void note_still(const Pose& pose, double distance, double duration);
  void read_velocity();
  // Writes the state of the body; false if it is gone.
  bool read(BodyState& state);
  // Returns a part of the shape as it collides now; null if its kind is not known.
  const Convex* convex_of_part(const btCollisionShape& part);
  // Returns the number of a part among `leaves`.
  int part_number(const btCollisionShape& part);
  void find_leaves();
  // Returns the axis that the surface runs about in the world, as long as its speed [m/s].
  Vec3 belt_axis() const;
  // Lets a body that PyBullet may put to sleep by its own rule start anew.
  void stir() const;
  bool lost_proxy() const { return shape != nullptr && proxy < 0; }
};

}  // namespace smartmesh
