// What a solver has to bring about at a contact, by the laws of contact alone: no engine is known here.
#pragma once

#include "contact/manifold.h"

namespace smartmesh {

// Coefficients of friction against sliding, against rolling and against spinning [m].
struct Friction {
  double sliding = 0.0, rolling = 0.0, spinning = 0.0;
};

// Surface of a body on the ground. `stiffness` [N/m], `damping` [N s/m]: of each contact of a soft body. `belt`: axis
// about which the surface runs, as long as its speed [m/s]. `mass` [kg]: of the body.
struct BodySurface {
  Friction friction;
  double restitution = 0.0;
  bool is_soft = false;
  double stiffness = 0.0, damping = 0.0;
  Vec3 belt;
  double mass = 1.0;
};

// How a solver corrects contacts. `erp`: share of a penetration that it corrects in a step. `slop` [m]: depth that it
// leaves. `slowest_bounce` [m/s]: least speed of an impact that bounces.
struct Correction {
  double erp, slop, slowest_bounce;
};

// Direction in which a contact slips, or would without friction; zero = any. `across`: largest share of its friction
// that acts across this direction.
struct Slip {
  Vec3 along;
  double across = 1.0;
};

// At the end of a step the body moves at a place `at` on the ground [m] along the `normal` at least at `speed` [m/s],
// less `softness` [1/kg] times the impulse of the contact. Without slip it moves along the ground at `slide` [m/s].
// `mass` [kg]: of a rigid body, as it meets a push there along the normal.
struct ContactRow {
  Vec3 at, normal;
  double speed = 0.0, softness = 0.0, mass = 0.0;
  Vec3 slide;
  Slip slip;
  Friction friction;
};

// Finds the rows of the contacts of a shape of a body, without their slips: places and normals are those of the middle
// of the step, relative to the centre there.
void find_rows(const Convex& shape, const Pose& pose, const std::vector<Contact>& contacts, const Approach& approach,
               const BodySurface& body, const Correction& solver, std::vector<ContactRow>& rows);

// Returns the velocity of the ground against a belt at a contact: at which the body moves where it does not slip.
Vec3 surface_velocity(const Vec3& belt, const Vec3& normal);

// Moves the places of the rows of contacts that resist rolling ahead, by the coefficient times the radius, as the
// middle of the pressures under a wheel does. `pull`: what gravity and applied forces add to the velocity of the body
// in the step [m/s]. A body that rolls slowly, or would begin to, is held.
void resist_rolling(const std::vector<Contact>& contacts, const Approach& approach, const Vec3& pull,
                    std::vector<ContactRow>& rows);

// Sets the slips of the rows of the contacts of a body of a `mass` [kg]; `before`: its contacts of the last step.
// `pull`: as above, and `last_pull` of the last step.
void find_slips(const std::vector<Contact>& contacts, const std::vector<OldContact>& before, const Approach& approach,
                const Vec3& pull, const Vec3& last_pull, double mass, std::vector<ContactRow>& rows);

}  // namespace smartmesh
