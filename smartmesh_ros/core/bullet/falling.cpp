#include "bullet/falling.h"

#include <cmath>

namespace smartmesh {

std::pair<std::vector<int>, std::vector<int>> check_falls(const Instant& now, Attached& attached, double time,
                                                          double depth) {
  attached.find_objects();
  std::vector<int> begun, lost;
  GroundReader reader = now.terrain->reader(time, INSTANT);
  for (const AttachedBody& body : attached.bodies) {
    for (int k : body.slots) {
      Slot& slot = attached.slots[k];
      if (!slot.kind.is_own || slot.rest.asleep || slot.object == nullptr) continue;
      const Vec3 at = from_bullet(slot.object->getWorldTransform().getOrigin());
      const double ground = reader.highest(at.x, at.y).height;
      const bool is_over = !std::isnan(ground);
      if (is_over || std::isnan(slot.last_ground.z)) slot.last_ground = {at.x, at.y, is_over ? ground : at.z};
      const double under = slot.last_ground.z - at.z;
      const bool fell = slot.falls != 0.0;
      slot.falls = !is_over && under > slot.body_shape->radius;
      if (slot.falls != 0.0 && !fell) begun.push_back(k);
      if (!is_over && under > depth) lost.push_back(k);  // one below ground is put back onto it
      break;                                             // of a robot, its first link counts
    }
  }
  return {begun, lost};
}

std::vector<int> find_nowhere(const Attached& attached, double farthest) {
  return attached.where([&](const Slot& slot) {
    if (slot.used && slot.body < 0) return true;
    if (slot.object == nullptr || slot.rest.asleep) return false;
    const btVector3 away = slot.object->getWorldTransform().getOrigin().absolute();
    return !(away.x() <= farthest && away.y() <= farthest && away.z() <= farthest);
  });
}

}  // namespace smartmesh
