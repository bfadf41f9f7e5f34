// Bodies that left the ground and fall, because there is none under them.
#include <cmath>

#include "bullet/world.h"

namespace smartmesh {

Falls BulletWorld::check_falls(double now, double depth) {
  find_objects();
  Falls found;
  GroundReader reader = terrain->reader(now, INSTANT);
  for (const OfBody& body : bodies_) {
    for (const Role& role : body.roles) {
      Slot& slot = slots_[role.slot];
      if (role.is_proxy || !slot.kind.is_own || slot.rest.asleep || slot.object == nullptr) continue;
      const Vec3 at = from_bullet(slot.object->getWorldTransform().getOrigin());
      const double ground = reader.at(at.x, at.y).height;
      const bool is_over = !std::isnan(ground);
      if (is_over || std::isnan(slot.last_ground.z)) slot.last_ground = {at.x, at.y, is_over ? ground : at.z};
      const double under = slot.last_ground.z - at.z;
      const bool fell = slot.falls;
      slot.falls = !is_over && under > slot.body_shape->radius;
      if (slot.falls && !fell) found.begun.push_back(role.slot);
      if (!is_over && under > depth) found.lost.push_back(role.slot);  // one below ground is put back onto it
      break;                                                           // of a robot, its first link counts
    }
  }
  return found;
}

std::vector<int> BulletWorld::find_falling() const {
  std::vector<int> found;
  for (std::size_t k = 0; k < slots_.size(); ++k)
    if (slots_[k].falls) found.push_back(static_cast<int>(k));
  return found;
}

}  // namespace smartmesh
