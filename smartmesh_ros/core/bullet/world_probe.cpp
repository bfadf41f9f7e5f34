// What the core reads in Bullet's memory, for a check that it was compiled for the PyBullet that runs.
#include "bullet/world.h"

#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/contact_points.h"

namespace smartmesh {

SolverSettings BulletWorld::settings() const {
  const btContactSolverInfo& solver = world_->getSolverInfo();
  return {from_bullet(world_->getGravity()), world_->getDispatchInfo().m_timeStep, solver.m_erp2, solver.m_frictionERP,
          solver.m_linearSlop};
}

std::vector<OldContact> BulletWorld::contacts_of(int slot) {
  find_objects();
  std::vector<OldContact> found;
  const btCollisionObject* ground = slots_[slot].ground;
  btDispatcher& dispatcher = *world_->getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds() && ground != nullptr; ++k) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    if (manifold.getBody0() == ground || manifold.getBody1() == ground) read_contacts(manifold, found);
  }
  return found;
}

}  // namespace smartmesh
