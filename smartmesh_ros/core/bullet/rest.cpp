#include "bullet/rest.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>
#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyJointMotor.h>

namespace smartmesh {

namespace {

// Share of a body's weight up to which a force on it is rounding.
constexpr double ROUNDING = 1e-9;

// The targets of a motor, which only derived classes may read.
struct Motor : btMultiBodyJointMotor {
  double velocity() const { return m_desiredVelocity; }
  void add_to(std::vector<double>& found) const {
    found.insert(found.end(), {m_desiredVelocity, m_desiredPosition, m_kd, m_kp, m_maxAppliedImpulse});
  }
};

// Returns the motor that PyBullet gave to the joint above a link; null if it has none.
const Motor* motor_of(const btMultibodyLink& link) {
  const bool is_single =
      link.m_jointType == btMultibodyLink::eRevolute || link.m_jointType == btMultibodyLink::ePrismatic;
  return is_single ? static_cast<const Motor*>(static_cast<const btMultiBodyConstraint*>(link.m_userPtr)) : nullptr;
}

bool differs(const btVector3& force, const btVector3& weight) {
  return (force - weight).length2() > ROUNDING * ROUNDING * weight.length2();
}

// Returns true if a torque acts at a joint beside PyBullet's damping.
bool is_torqued(const btMultiBody& robot, const btMultibodyLink& link) {
  const btScalar* speeds = robot.getVelocityVector() + 6 + link.m_dofOffset;
  for (int dof = 0; dof < link.m_dofCount; ++dof)
    if (link.m_jointTorque[dof] + link.m_jointDamping * speeds[dof] != 0.0) return true;
  return false;
}

bool is_acted_on(const btMultiBody& robot, const btVector3& gravity) {
  if (differs(robot.getBaseForce(), gravity * robot.getBaseMass()) || !robot.getBaseTorque().isZero()) return true;
  for (int k = 0; k < robot.getNumLinks(); ++k) {
    const btMultibodyLink& link = robot.getLink(k);
    const Motor* motor = motor_of(link);
    if (is_torqued(robot, link) || (motor != nullptr && motor->velocity() != 0.0)) return true;
    if (differs(link.m_appliedForce, gravity * link.m_mass) || !link.m_appliedTorque.isZero()) return true;
  }
  return false;
}

bool is_pushed(const btMultiBody& robot) {
  const btScalar* speeds = robot.getVelocityVector();
  if (std::any_of(speeds, speeds + 6 + robot.getNumDofs(), [](double speed) { return speed != 0.0; })) return true;
  if (!robot.getBaseForce().isZero() || !robot.getBaseTorque().isZero()) return true;
  for (int k = 0; k < robot.getNumLinks(); ++k) {
    const btMultibodyLink& link = robot.getLink(k);
    if (is_torqued(robot, link) || !link.m_appliedForce.isZero() || !link.m_appliedTorque.isZero()) return true;
  }
  return false;
}

void move_up(btCollisionObject& object, double by) {
  for (btTransform* pose : {&object.getWorldTransform(), &object.getInterpolationWorldTransform()})
    pose->getOrigin().setZ(pose->getOrigin().z() + by);
}

}  // namespace

bool is_acted_on(btCollisionObject& object, const btVector3& gravity) {
  if (const btMultiBody* robot = robot_of(object)) return is_acted_on(*robot, gravity);
  const btRigidBody& body = *btRigidBody::upcast(&object);
  return differs(body.getTotalForce(), body.getGravity() / body.getInvMass()) || !body.getTotalTorque().isZero();
}

bool joints_rest(btCollisionObject& object, double fastest) {
  const btMultiBody* robot = robot_of(object);
  if (robot == nullptr) return true;
  const btScalar* speeds = robot->getVelocityVector() + 6;
  return std::all_of(speeds, speeds + robot->getNumDofs(), [&](double speed) { return std::abs(speed) <= fastest; });
}

bool is_pushed(btCollisionObject& object) {
  if (const btMultiBody* robot = robot_of(object)) return is_pushed(*robot);
  const btRigidBody& body = *btRigidBody::upcast(&object);
  return !body.getLinearVelocity().isZero() || !body.getAngularVelocity().isZero() || !body.getTotalForce().isZero() ||
         !body.getTotalTorque().isZero();
}

std::vector<double> motors_of(btCollisionObject& object) {
  std::vector<double> found;
  const btMultiBody* robot = robot_of(object);
  for (int k = 0; robot != nullptr && k < robot->getNumLinks(); ++k)
    if (const Motor* motor = motor_of(robot->getLink(k))) motor->add_to(found);
  return found;
}

Activation let_sleep(btCollisionObject& object) {
  const auto ask = [](btCollisionObject& each) {
    each.forceActivationState(WANTS_DEACTIVATION);
    each.setDeactivationTime(0.0);
  };
  Activation before{object.getActivationState()};
  if (btMultiBody* robot = robot_of(object)) {
    before.can_sleep = robot->getCanSleep(), before.can_wake = robot->getCanWakeup();
    robot->setCanWakeup(true), robot->setCanSleep(true);
    robot->setCanWakeup(false);  // its motors would wake it
    robot->goToSleep();
    for_each_collider(*robot, ask);
  } else {
    ask(object);
  }
  return before;
}

void rouse(btCollisionObject& object, const std::optional<Activation>& before, const btVector3& gravity) {
  if (btMultiBody* robot = robot_of(object)) {
    if (before) robot->setCanWakeup(true), robot->setCanSleep(before->can_sleep), robot->setCanWakeup(before->can_wake);
    robot->wakeUp();
    for_each_collider(*robot, [&](btCollisionObject& each) {
      if (before) each.forceActivationState(before->state);
      each.activate();
    });
    return;
  }
  if (before) object.forceActivationState(before->state);
  object.activate();
  btRigidBody& body = *btRigidBody::upcast(&object);
  if ((body.getFlags() & BT_DISABLE_WORLD_GRAVITY) == 0) body.setGravity(gravity);  // Bullet sets that of awake bodies
}

void add_weight(btCollisionObject& object, const btVector3& gravity) {
  btMultiBody* robot = robot_of(object);
  if (robot == nullptr) return btRigidBody::upcast(&object)->applyGravity();
  robot->addBaseForce(gravity * robot->getBaseMass());
  for (int k = 0; k < robot->getNumLinks(); ++k) robot->getLink(k).m_appliedForce += gravity * robot->getLink(k).m_mass;
}

void forget_forces(btCollisionObject& object) {
  btMultiBody* robot = robot_of(object);
  if (robot == nullptr) return;
  robot->addBaseForce(-robot->getBaseForce());
  robot->addBaseTorque(-robot->getBaseTorque());
  for (int k = 0; k < robot->getNumLinks(); ++k) {
    btMultibodyLink& link = robot->getLink(k);
    link.m_appliedForce.setZero(), link.m_appliedTorque.setZero();
    std::fill_n(link.m_jointTorque, link.m_dofCount, 0.0);
  }
}

void lift(btCollisionObject& object, double by) {
  btMultiBody* robot = robot_of(object);
  if (robot == nullptr) return move_up(object, by);
  const btVector3 up(0.0, 0.0, by);
  robot->setBasePos(robot->getBasePos() + up);
  for (int k = 0; k < robot->getNumLinks(); ++k) robot->getLink(k).m_cachedWorldTransform.getOrigin() += up;
  for_each_collider(*robot, [&](btCollisionObject& each) { move_up(each, by); });
}

}  // namespace smartmesh
