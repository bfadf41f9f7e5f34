#include "bullet/object_velocity.h"

#include <vector>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>

#include "bullet/convert.h"

namespace smartmesh {

namespace {

// Returns the velocity of a link (-1 = the base) now, from the velocities of the base and of the joints on the way to
// it: Bullet keeps those of the last step only.
FrameVelocity link_velocity(const btMultiBody& body, int link) {
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

}  // namespace

FrameVelocity velocity_of(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return link_velocity(*collider->m_multiBody, collider->m_link);
  const auto* body = btRigidBody::upcast(&object);
  if (body == nullptr) return {};
  return {from_bullet(body->getLinearVelocity()), from_bullet(body->getAngularVelocity())};
}

}  // namespace smartmesh
