// What a saved state has of the ground in a Bullet world, and the forgetting of the past.
#include <algorithm>

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/broadphase.h"
#include "bullet/carrier.h"
#include "bullet/shape_parts.h"
#include "bullet/world.h"

namespace smartmesh {

namespace {

// Numbers of a part on the soil before those of its contacts and its rim.
struct PartMemory {
  double number, near, is_set_down, speed;  // `near`: it was near the soil in the last step
  Vec3 at;
  SoilSums sums;
  double contacts, rim;  // how many numbers each has
};
constexpr std::size_t PART = sizeof(PartMemory) / sizeof(double);

}  // namespace

void BulletWorld::find_parts(Slot& slot) {
  if (!slot.leaves.empty()) return;
  for_each_part(*slot.object->getCollisionShape(), btTransform::getIdentity(),
                [&](const btCollisionShape& part, const btTransform&) { slot.leaves.push_back(&part); });
}

int BulletWorld::part_number(Slot& slot, const btCollisionShape& shape) {
  find_parts(slot);
  return static_cast<int>(std::find(slot.leaves.begin(), slot.leaves.end(), &shape) - slot.leaves.begin());
}

SlotMemory BulletWorld::memory_of(int index) const {
  const Slot& slot = slots_[index];
  return {slot.rest.still, slot.rest.anchor, slot.pull, slot.ground_angular, slot.last_ground, slot.falls ? 1.0 : 0.0};
}

void BulletWorld::recall(int index, const SlotMemory& memory) {
  Slot& slot = slots_[index];
  slot.rest.still = memory.still, slot.rest.anchor = memory.anchor;
  slot.pull = memory.pull, slot.ground_angular = memory.ground_angular;
  slot.last_ground = memory.last_ground, slot.falls = memory.falls != 0.0;
  gravity_ = world_->getGravity();  // another one wakes all
}

std::vector<double> BulletWorld::parts_memory(int index) const {
  std::vector<double> found;
  if (soil == nullptr) return found;
  for (const auto& [number, part] : slots_[index].on_soil) {
    std::vector<double> rim;
    part.rim.write(rim);
    const PartMemory memory{static_cast<double>(number),
                            static_cast<double>(soil->was_near(part)),
                            static_cast<double>(part.is_set_down),
                            part.speed,
                            part.at,
                            part.sums,
                            static_cast<double>(part.up.size()),
                            static_cast<double>(rim.size())};
    const auto* numbers = reinterpret_cast<const double*>(&memory);
    found.insert(found.end(), numbers, numbers + PART);
    found.insert(found.end(), part.up.begin(), part.up.end());
    found.insert(found.end(), rim.begin(), rim.end());
  }
  return found;
}

bool BulletWorld::recall_parts(int index, const double* numbers, std::size_t count) {
  Slot& slot = slots_[index];
  if (slot.object == nullptr || soil == nullptr) return count == 0;
  find_parts(slot);
  SoilParts parts;
  while (count > 0) {
    if (count < PART) return false;
    const PartMemory memory = *reinterpret_cast<const PartMemory*>(numbers);
    const double most = static_cast<double>(count - PART);
    if (!(memory.number >= 0.0 && memory.number < slot.leaves.size() && memory.contacts >= 0.0 && memory.rim >= 0.0 &&
          memory.contacts + memory.rim <= most))
      return false;
    const auto contacts = static_cast<std::size_t>(memory.contacts), rim = static_cast<std::size_t>(memory.rim);
    const int number = static_cast<int>(memory.number);
    const Convex* convex = convex_of_part(slot, *slot.leaves[number]);
    SoilPart& part = parts[number];
    if (convex == nullptr || !part.rim.read(numbers + PART + contacts, rim)) return false;
    part.shape = pressing_shape(*convex);
    part.step = memory.near != 0.0 ? soil->step() - 1 : -1;
    part.is_set_down = memory.is_set_down != 0.0, part.speed = memory.speed, part.at = memory.at,
    part.sums = memory.sums;
    part.up.assign(numbers + PART, numbers + PART + contacts);
    numbers += PART + contacts + rim, count -= PART + contacts + rim;
  }
  slot.on_soil = std::move(parts);
  return true;
}

void BulletWorld::take_restored() {
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k)
    if (auto* body = btRigidBody::upcast(objects[k])) body->setCenterOfMassTransform(body->getWorldTransform());
}

void BulletWorld::forget() {
  wake_all();
  renew_broadphase(*world_);
  revision_ = -1;
  vacated_.clear(), beside_.clear(), carried_.clear();
  others_listed_ = false, carried_layout_ = -1;
  for (Slot& slot : slots_) {
    slot.pull = slot.ground_angular = {};
    slot.rest.still = 0.0, slot.rest.anchor = Rest{}.anchor;
    slot.on_soil.clear();
  }
  auto& objects = world_->getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) objects[k]->setDeactivationTime(0.0), renew_inertia(*objects[k]);
}

}  // namespace smartmesh
