#include "bullet/attached.h"

#include <algorithm>

namespace smartmesh {

AttachedBody& Attached::body(int number) {
  if (number >= static_cast<int>(bodies.size())) bodies.resize(number + 1);
  return bodies[number];
}

bool Attached::has_body(int number) const {
  return number >= 0 && number < static_cast<int>(bodies.size()) && !bodies[number].slots.empty();
}

Slot* Attached::slot_of(const btCollisionObject& proxy) {
  const btCollisionShape& shape = *proxy.getCollisionShape();
  if (shape.getShapeType() != GROUND_SHAPE_TYPE) return nullptr;
  return &slots[static_cast<const GroundShape&>(shape).slot];
}

Slot* Attached::moving_slot(const AttachedBody& body) {
  for (int k : body.slots)
    if (slots[k].object != nullptr && !slots[k].object->isStaticOrKinematicObject()) return &slots[k];
  return nullptr;
}

void Attached::find_objects() {
  if (known_ == world_.getNumCollisionObjects()) return;
  known_ = world_.getNumCollisionObjects();
  ++searches_;
  for (Slot& slot : slots) slot.object = nullptr, slot.ground = nullptr;
  auto& objects = world_.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    btCollisionObject* object = objects[k];
    const auto [number, link] = name_of(*object);
    if (Slot* slot = slot_of(*object); slot != nullptr) slot->ground = btRigidBody::upcast(object);
    if (!has_body(number)) continue;
    for (int index : bodies[number].slots)
      if (slots[index].link == link) slots[index].object = object;
  }
}

void Attached::note_removed(int number) {
  note_change();
  if (number < 0 || number >= static_cast<int>(bodies.size())) return;
  for (int k : bodies[number].slots) slots[k].object = nullptr, slots[k].body = -1, ++gone_;
  if (const int k = bodies[number].proxy_of; k >= 0) slots[k].ground = nullptr, slots[k].proxy = -1, ++gone_;
  bodies[number] = {};
}

std::vector<int> Attached::find_gone(bool of_proxies) const {
  return where([&](const Slot& slot) {
    const bool is_gone = slot.body < 0;
    return slot.used && (of_proxies ? !is_gone && slot.lost_proxy() : is_gone);
  });
}

std::vector<AttachedRow> Attached::rows() {
  std::vector<AttachedRow> rows(slots.size());
  BodyState state;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    Slot& it = slots[k];
    const auto& [solid, own, remote] = it.kind;
    if (it.used && it.read(state))
      rows[k] = {state.pose.at, state.linear, it.body_shape->radius, 1.0 * own, 1.0 * remote, 1.0 * solid};
  }
  return rows;
}

void Attached::remove(int index) {
  Slot& slot = slots[index];
  if (slot.body >= 0) {
    std::vector<int>& left = bodies[slot.body].slots;
    left.erase(std::remove(left.begin(), left.end(), index), left.end());
  }
  if (slot.proxy >= 0) bodies[slot.proxy].proxy_of = -1;
  gone_ -= (slot.body < 0) + slot.lost_proxy();
  slot = Slot{};
  note_change();
}

void Attached::list() {
  if (listed_at_ == rest_changes_) return;
  listed_at_ = rest_changes_;
  awake.clear(), asleep.clear();
  for (std::size_t k = 0; k < slots.size(); ++k)
    if (slots[k].used) (slots[k].rest.asleep ? asleep : awake).push_back(static_cast<int>(k));
}

}  // namespace smartmesh
