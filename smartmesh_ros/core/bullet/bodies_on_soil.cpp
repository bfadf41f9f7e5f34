#include "bullet/bodies_on_soil.h"

#include <algorithm>

namespace smartmesh {

// A robot rests on those of its links alike that touched the soil in the last step.
OnSoil on_soil(const Instant& now, const Attached& attached, const Slot& slot, double step) {
  int count = 0;
  for (int k : attached.bodies[slot.body].slots)
    for (const auto& [number, part] : attached.slots[k].on_soil) count += now.soil->was_near(part) && !part.up.empty();
  OnSoil found;
  found.pose = from_bullet(slot.object->getWorldTransform());
  found.soil = now.soil->motion_at(found.pose.at, now.time, step);
  found.approach.centre = found.pose.at;
  found.approach.linear = slot.linear - found.soil.velocity, found.approach.angular = slot.angular;
  found.approach.ground = found.soil.velocity;
  found.approach.duration = step;
  found.approach.gravity = from_bullet(now.world.getGravity());
  if (slot.belt.speed != 0.0) found.belt = slot.belt_axis();
  found.mass = mass_of(*slot.object) / std::max(count, 1);
  found.time = now.time;
  return found;
}

void press_soil(const Instant& now, Attached& attached) {
  if (now.soil == nullptr) return;
  for (Slot& slot : attached.slots) {
    if (slot.on_soil.empty() || slot.object == nullptr || slot.ground == nullptr) continue;
    if (!slot.object->isActive()) continue;
    slot.read_velocity();
    now.soil->press(on_soil(now, attached, slot, now.duration), slot.on_soil);
  }
  now.soil->next();
}

}  // namespace smartmesh
