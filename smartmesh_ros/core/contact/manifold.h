// Choice of the contacts that a solver gets: at most four, the same from step to step for a body at rest.
#pragma once

#include <vector>

#include "contact/contact.h"

namespace smartmesh {

constexpr int MOST_CONTACTS = 4;

// A contact of the last step, its impulse along the normal, and the impulse of friction on the body [N s].
struct OldContact {
  int body_feature, ground_feature;
  Vec3 point;
  double normal_impulse;
  Vec3 friction;
};

// Reduces contacts to at most four: the one that closes the most, then those that close although the others hold the
// shape, then those that span the largest area. Contacts that were there in the last step are preferred.
void choose_contacts(const Convex& shape, const Pose& pose, const Approach& approach,
                     const std::vector<OldContact>& before, std::vector<Contact>& contacts);

// Returns the contact of the last step, `ago` [s], that became this one: of the same features, or else the nearest on
// the ground, which moved since; null = none.
const OldContact* matching(const Contact& contact, const std::vector<OldContact>& before, double ago);

}  // namespace smartmesh
