// Sleeping bodies move with corrections of the ground under them that do not wake them.
#include <cmath>

#include "bullet/sleep.h"

namespace smartmesh {

namespace {

// Moves what Bullet knows of a sleeping object's bounds.
void lift_bounds(const btCollisionObject& object, const btVector3& up, btDiscreteDynamicsWorld& world) {
  btBroadphaseProxy* bounds = const_cast<btBroadphaseProxy*>(object.getBroadphaseHandle());
  world.getBroadphase()->setAabb(bounds, bounds->m_aabbMin + up, bounds->m_aabbMax + up, world.getDispatcher());
}

}  // namespace

// Moves a sleeping body with the corrections of the ground under it since it fell asleep, on average, if that is more
// than `least` [m]. A robot moves as a whole.
void Sleep::follow_corrections(AttachedBody& body, double least) {
  double sum = 0.0;
  int count = 0;
  Slot* any = nullptr;
  for (int k : body.slots) {
    Slot& slot = attached_.slots[k];
    if (!slot.rest.asleep) continue;
    if (slot.object == nullptr) return;
    any = &slot;
    if (slot.rest.samples > 0) sum += slot.rest.corrected, ++count;
  }
  const double by = count > 0 ? sum / count - body.sleeper.followed : 0.0;
  const btMultiBody* robot = any == nullptr ? nullptr : robot_of(*any->object);
  if (!(std::abs(by) > least) || (robot != nullptr && robot->getBaseCollider()->isStaticOrKinematicObject())) return;
  body.sleeper.followed += by;
  const btVector3 up(0.0, 0.0, by);
  lift(*any->object, by);
  for (int k : body.slots) {
    Slot& slot = attached_.slots[k];
    if (!slot.rest.asleep) continue;
    slot.rest.pose = slot.object->getWorldTransform();
    lift_bounds(*slot.object, up, now_.world);
    slot.rest.bounds = bounds_of(*slot.object);
    if (slot.ground == nullptr) continue;
    lift(*slot.ground, by);
    slot.shape->origin += up;
    lift_bounds(*slot.ground, up, now_.world);
    slot.rest.raised += by;
  }
  any_raised_ = true;
  attached_.note_rest_change();
}

// Moves the contacts of bodies that followed corrections.
void Sleep::raise_contacts() {
  if (!any_raised_) return;
  btDispatcher& dispatcher = *now_.world.getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    const Slot* slot = attached_.slot_of(*manifold.getBody0());
    if (slot == nullptr) slot = attached_.slot_of(*manifold.getBody1());
    if (slot == nullptr || slot->rest.raised == 0.0) continue;
    const btVector3 up(0.0, 0.0, slot->rest.raised);
    for (int p = 0; p < manifold.getNumContacts(); ++p)
      manifold.getContactPoint(p).m_positionWorldOnA += up, manifold.getContactPoint(p).m_positionWorldOnB += up;
  }
  for (Slot& slot : attached_.slots) slot.rest.raised = 0.0;
  any_raised_ = false;
}

}  // namespace smartmesh
