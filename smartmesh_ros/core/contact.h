// Contacts of a convex shape with a patch of ground, exact for each pair of features.
//
// Candidates are the pairs of features that are nearest to each other within their surroundings: a vertex of the shape
// and a facet, edge or peak of the ground; a peak and a face or edge of the shape; two edges. The normal of a pair lies
// in the normal cones of both features, so that inner edges of flat ground have no contacts.
#pragma once

#include "convex.h"
#include "patch.h"

namespace smartmesh {

// Contact point. `point`: on the ground [m]. `normal`: unit, from the ground into the body. `distance` [m]: negative
// inside the ground. `body_feature`, `ground_feature`: names of the two features, equal from step to step. `friction`:
// coefficient of the ground there. `ground`: motion of the ground there, mean over the step. `deck`: number of the deck that
// it is on, -1 = none. `yields` [1/kg]: change of the ground's velocity by an impulse along the normal.
struct Contact {
  Vec3 point, normal;
  double distance;
  int body_feature, ground_feature;
  double friction = 1.0;
  GroundMotion ground{};
  int deck = -1;
  double yields = 0.0;
};

// Motion of a body relative to ground that moves as one, and how far contacts are looked for. Contacts have velocities of
// their own, which differ from that of this ground by at most what `margin` allows for.
struct Approach {
  Vec3 linear, angular, centre;  // [m/s], [rad/s], and the point that moves at `linear` [m]
  double duration = 0.0;         // of the step [s]
  double margin = 0.0;           // distance up to which contacts are found beside the motion [m]
  Vec3 gravity{};                // [m/s^2]
  Vec3 ground{};                 // velocity of the ground [m/s]
  double ahead = 0.0;            // time over which velocities of the ground are means [s]; zero = it counts as still

  Vec3 velocity_at(const Vec3& p) const { return linear + cross(angular, p - centre); }
  // Returns the velocity of the body relative to the ground at a contact [m/s].
  Vec3 velocity_at(const Contact& contact) const { return velocity_at(contact.point) + ground - contact.ground.velocity; }
  // Distance up to which any point of a ball around `p` may come to the ground in the step [m].
  double reach(const Vec3& p, double radius) const {
    return margin + (norm(linear) + norm(angular) * (norm(p - centre) + radius)) * duration;
  }
};

}  // namespace smartmesh
