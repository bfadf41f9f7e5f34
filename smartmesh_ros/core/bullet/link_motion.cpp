#include "bullet/link_motion.h"

#include <vector>

#include "bullet/convert.h"

namespace smartmesh {

LinkVelocity link_velocity(const btMultiBody& body, int link) {
  std::vector<int> way;  // from the link to the base
  for (int k = link; k >= 0; k = body.getLink(k).m_parent) way.push_back(k);
  const btScalar* joints = body.getVelocityVector() + 6;
  const btMatrix3x3 base(body.getWorldToBaseRot());
  btVector3 angular = base * body.getBaseOmega(), linear = base * body.getBaseVel();  // in the link's frame
  btMatrix3x3 world_from_link = base.transpose();
  for (auto k = way.rbegin(); k != way.rend(); ++k) {
    const btMultibodyLink& it = body.getLink(*k);
    const btMatrix3x3 rotation(it.m_cachedRotParentToThis);
    angular = rotation * angular;
    linear = rotation * linear + angular.cross(it.m_cachedRVector);
    for (int dof = 0; dof < it.m_dofCount; ++dof) {
      angular += joints[it.m_dofOffset + dof] * it.getAxisTop(dof);
      linear += joints[it.m_dofOffset + dof] * it.getAxisBottom(dof);
    }
    world_from_link = world_from_link * rotation.transpose();
  }
  return {from_bullet(world_from_link * linear), from_bullet(world_from_link * angular)};
}

}  // namespace smartmesh
