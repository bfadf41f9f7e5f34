#include "bullet/carrier.h"

#include <cmath>
#include <vector>

#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyLinkCollider.h>
#include <LinearMath/btTransformUtil.h>

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

// How the base and the joints of a robot answer a unit impulse at a point of a link.
struct Answer {
  btAlignedObjectArray<btScalar> jacobian, change;

  Answer(btMultiBody& robot, int link, const btVector3& point, const btVector3& along) {
    btAlignedObjectArray<btScalar> scratch;
    btAlignedObjectArray<btVector3> vectors;
    btAlignedObjectArray<btMatrix3x3> matrices;
    const int size = robot.getNumDofs() + 6;
    jacobian.resize(size, 0.0), change.resize(size, 0.0);
    robot.fillConstraintJacobianMultiDof(link, point, btVector3(0, 0, 0), along, &jacobian[0], scratch, vectors,
                                         matrices);
    robot.calcAccelerationDeltasMultiDof(&jacobian[0], &change[0], scratch, vectors);
  }

  double yield() const {
    double sum = 0.0;
    for (int k = 0; k < jacobian.size(); ++k) sum += jacobian[k] * change[k];
    return sum > 0.0 && std::isfinite(sum) ? sum : 0.0;  // before its first step Bullet does not know a robot's inertia
  }
};

}  // namespace

FrameVelocity velocity_of(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return link_velocity(*collider->m_multiBody, collider->m_link);
  const auto* body = btRigidBody::upcast(&object);
  if (body == nullptr) return {};
  return {from_bullet(body->getLinearVelocity()), from_bullet(body->getAngularVelocity())};
}

double yield_of(const btCollisionObject& object, const Vec3& point, const Vec3& along) {
  if (object.isStaticOrKinematicObject()) return 0.0;
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return Answer(*collider->m_multiBody, collider->m_link, to_bullet(point), to_bullet(along)).yield();
  return btRigidBody::upcast(&object)->computeImpulseDenominator(to_bullet(point), to_bullet(along));
}

void renew_inertia(btCollisionObject& object) {
  if (auto* body = btRigidBody::upcast(&object)) body->setCenterOfMassTransform(body->getWorldTransform());
  auto* collider = btMultiBodyLinkCollider::upcast(&object);
  if (collider == nullptr) return;
  btAlignedObjectArray<btScalar> scratch;
  btAlignedObjectArray<btVector3> vectors;
  btAlignedObjectArray<btMatrix3x3> matrices;
  collider->m_multiBody->computeAccelerationsArticulatedBodyAlgorithmMultiDof(0.0, scratch, vectors, matrices, false,
                                                                              false, false);
}

void push(btCollisionObject& object, const Vec3& point, const Vec3& impulse, double duration) {
  const double size = norm(impulse);
  if (!(size > 0.0)) return;
  if (auto* collider = btMultiBodyLinkCollider::upcast(&object)) {
    btMultiBody& robot = *collider->m_multiBody;
    Answer answer(robot, collider->m_link, to_bullet(point), to_bullet(unit(impulse)));
    if (!(answer.yield() > 0.0)) return;
    robot.applyDeltaVeeMultiDof(&answer.change[0], size);
    robot.stepPositionsMultiDof(duration * size, nullptr, &answer.change[0]);
    btAlignedObjectArray<btQuaternion> rotations;
    btAlignedObjectArray<btVector3> origins;
    robot.forwardKinematics(rotations, origins);
    robot.updateCollisionObjectWorldTransforms(rotations, origins);
    return;
  }
  btRigidBody& body = *btRigidBody::upcast(&object);
  const btVector3 linear = body.getLinearVelocity(), angular = body.getAngularVelocity();
  body.applyImpulse(to_bullet(impulse), to_bullet(point) - body.getWorldTransform().getOrigin());
  btTransform moved;
  btTransformUtil::integrateTransform(body.getWorldTransform(), body.getLinearVelocity() - linear,
                                      body.getAngularVelocity() - angular, duration, moved);
  body.setCenterOfMassTransform(moved);
}

}  // namespace smartmesh
