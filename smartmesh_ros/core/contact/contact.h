// Contacts of a convex shape with a patch of ground, exact for each pair of features.
//
// Candidates are the pairs of features that are nearest to each other within their surroundings: a vertex of the shape
// and a facet, edge or peak of the ground; a peak and a face or edge of the shape; two edges. The normal of a pair lies
// in the normal cones of both features, so that inner edges of flat ground have no contacts.
#pragma once

#include "map/material.h"
#include "mesh/patch.h"
#include "shape/convex.h"

namespace smartmesh {

// What the normal of a contact turns with: the ground whose facet touches, the body whose face touches, or both, whose
// edges cross.
enum class NormalOf { Ground, Body, Edges };

// Contact point. `point`: on the ground [m]. `normal`: unit, from the ground into the body. `distance` [m]: negative
// inside the ground. `body_feature`, `ground_feature`: names of the two features, equal from step to step. `material`,
// `ground`: material of the ground there, and its motion, mean over the step. `deck`: number of the deck that it is on,
// -1 = none. `on_mesh`: it is on a triangle mesh. `body_edge`, `ground_edge`: unit directions of edges that cross.
// `ground_turn` [1/s]: rate of change of `ground_edge`.
struct Contact {
  Vec3 point, normal;
  double distance;
  int body_feature, ground_feature;
  Material material{};
  GroundMotion ground{};
  int deck = -1;
  bool on_mesh = false;
  NormalOf normal_of = NormalOf::Ground;
  Vec3 body_edge{}, ground_edge{}, ground_turn{};
};

// Largest speed of a point of a shape after an impact elsewhere, in terms of the speeds before. The end of a rod whose
// other end hits the ground reaches 1.5 times its speed, the corner of a plate 1.7 times.
constexpr double IMPACT = 2.0;

// Largest angle by which a body turns in a step [rad]: PyBullet turns no free body farther. Where a link does, its
// features of now say nothing of what it touches then.
constexpr double MOST_TURN = 0.25 * M_PI;

// Motion of a body relative to ground that moves as one, and how far contacts are looked for. Contacts have velocities
// of their own, which differ from that of this ground by at most what `margin` allows for.
struct Approach {
  Vec3 linear, angular, centre;  // [m/s], [rad/s], and the point that moves at `linear` [m]
  double duration = 0.0;         // of the step [s]
  double margin = 0.0;           // distance up to which contacts are found beside the motion [m]
  Vec3 gravity{};                // [m/s^2]
  Vec3 ground{};                 // velocity of the ground [m/s]
  double ahead = 0.0;            // time over which velocities of the ground are means [s]; zero = it counts as still
  // Of shapes that are touched at several places at once: IMPACT, the angle by which the shape rotates [rad], and the
  // bounding radius [m].
  double impact = 1.0, angle = 0.0, size = 1e300;
  double farthest = 1e300;  // that a point of the shape comes in the step, however fast the shape spins [m]

  // Returns the same with a margin that is larger `by` so much [m].
  Approach with_margin(double by) const {
    Approach found = *this;
    found.margin += by;
    return found;
  }
  Vec3 velocity_at(const Vec3& p) const { return linear + cross(angular, p - centre); }
  // Returns the velocity of the body relative to the ground at a contact [m/s].
  Vec3 velocity_at(const Contact& contact) const {
    return velocity_at(contact.point) + ground - contact.ground.velocity;
  }
  // Angle by which the shape may rotate in the step, also after an impact along `n` [rad].
  double angle_after_impact(const Vec3& n) const {
    return std::min(angle + std::max(0.0, -dot(n, linear)) * duration / size, MOST_TURN);
  }
  // Distance up to which a point that moves at `v` may come to the ground in the step [m], also after an impact
  // elsewhere.
  double contact_distance(const Vec3& v) const { return contact_distance(norm(v)); }
  double contact_distance(double speed) const { return margin + std::min(impact * speed * duration, farthest); }
  // The same for any point of a ball around `p`.
  double contact_distance(const Vec3& p, double radius) const {
    return contact_distance(norm(linear) + norm(angular) * (norm(p - centre) + radius));
  }
};

}  // namespace smartmesh
