#include "bullet/falling.h"

#include <cmath>

namespace smartmesh {

Falls check_falls(const Instant& now, Attached& attached, double time, double depth) {
  attached.find_objects();
  Falls found;
  GroundReader reader = now.terrain->reader(time, INSTANT);
  for (const AttachedBody& body : attached.bodies) {
    for (int k : body.slots) {
      Slot& slot = attached.slots[k];
      if (!slot.kind.is_own || slot.rest.asleep || slot.object == nullptr) continue;
      const Vec3 at = from_bullet(slot.object->getWorldTransform().getOrigin());
      const double ground = reader.at(at.x, at.y).height;
      const bool is_over = !std::isnan(ground);
      if (is_over || std::isnan(slot.last_ground.z)) slot.last_ground = {at.x, at.y, is_over ? ground : at.z};
      const double under = slot.last_ground.z - at.z;
      const bool fell = slot.falls;
      slot.falls = !is_over && under > slot.body_shape->radius;
      if (slot.falls && !fell) found.begun.push_back(k);
      if (!is_over && under > depth) found.lost.push_back(k);  // one below ground is put back onto it
      break;                                                   // of a robot, its first link counts
    }
  }
  return found;
}

std::vector<int> find_falling(const Attached& attached) {
  std::vector<int> found;
  for (std::size_t k = 0; k < attached.slots.size(); ++k)
    if (attached.slots[k].falls) found.push_back(static_cast<int>(k));
  return found;
}

std::vector<int> find_nowhere(const Attached& attached, double farthest) {
  std::vector<int> found;
  for (std::size_t k = 0; k < attached.slots.size(); ++k) {
    const Slot& slot = attached.slots[k];
    if (slot.object == nullptr || slot.rest.asleep) continue;
    const btVector3 away = slot.object->getWorldTransform().getOrigin().absolute();
    if (!(away.x() <= farthest && away.y() <= farthest && away.z() <= farthest)) found.push_back(static_cast<int>(k));
  }
  return found;
}

}  // namespace smartmesh
