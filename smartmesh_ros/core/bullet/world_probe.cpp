#include "bullet/world_probe.h"

#include "bullet/contact_points.h"

namespace smartmesh {

SolverSettings settings_of(btDiscreteDynamicsWorld& world) {
  const btContactSolverInfo& solver = world.getSolverInfo();
  return {from_bullet(world.getGravity()), world.getDispatchInfo().m_timeStep, solver.m_erp2, solver.m_frictionERP,
          solver.m_linearSlop};
}

std::vector<OldContact> contacts_of(btDiscreteDynamicsWorld& world, const btCollisionObject& proxy) {
  std::vector<OldContact> found;
  btDispatcher& dispatcher = *world.getDispatcher();
  for (int k = 0; k < dispatcher.getNumManifolds(); ++k) {
    const btPersistentManifold& manifold = *dispatcher.getManifoldByIndexInternal(k);
    if (manifold.getBody0() == &proxy || manifold.getBody1() == &proxy) read_contacts(manifold, found);
  }
  return found;
}

}  // namespace smartmesh
