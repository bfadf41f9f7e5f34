// Contacts of attached bodies with the ground of their proxies.
#pragma once

#include <optional>
#include <vector>

#include "bullet/carried_decks.h"
#include "contact/contact_search.h"

class btCollisionObjectWrapper;
class btPersistentManifold;

namespace smartmesh {

class Narrowphase {
 public:
  Narrowphase(const Instant& now, Attached& attached, CarriedDecks& carried)
      : now_(now), attached_(attached), carried_(carried) {}

  // Finds the contacts of a part of the body in a slot with the ground, in a step of some duration [s]. `with_soil`:
  // takes those with soil, null = there is none.
  void touch(Slot& slot, const btCollisionObjectWrapper& part, btPersistentManifold& with_ground,
             btPersistentManifold* with_soil, double step);
  // Returns the deepest contact of the body in a slot with the ground now; none if it does not touch it.
  std::optional<Contact> deepest_contact(Slot& slot);

  // Presses the soil, if there is any, to where the awake bodies are at the end of a step.
  void press_soil();

  std::vector<TruePoint> told;  // points of this step, where the solver was told something else than what is true
  // Writes what is true of them, for those who read it after the step.
  void restore_told();

 private:
  Approach approach_of(const Slot& slot, double step) const;
  // Returns the time in which the solver's friction closes a distance [s].
  double anchor_time(double step) const;
  // Returns the body in a slot as the soil, which there must be, sees it now, in a step of some duration [s]; `ahead`:
  // as in `motion_around`.
  OnSoil on_soil(const Slot& slot, double step, double ahead) const;
  // Finds the contacts and their rows with ground that is no soil.
  void touch_ground(const Slot& slot, const Convex& shape, const Pose& pose, const SoilBelow& soil,
                    const Approach& approach, const Vec3& pull);
  // Puts the contacts into a manifold.
  void tell(Slot& slot, const Approach& approach, const Vec3& pull, btPersistentManifold& manifold);

  const Instant& now_;
  Attached& attached_;
  CarriedDecks& carried_;
  std::vector<Contact> contacts_;
  std::vector<OldContact> before_;
  std::vector<ContactRow> rows_;
  GroundContacts search_;
};

}  // namespace smartmesh
