#include "bullet/objects.h"

#include <stdexcept>

#include <BulletCollision/CollisionShapes/btCollisionShape.h>
#include <BulletDynamics/ConstraintSolver/btTypedConstraint.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

namespace smartmesh {

ObjectName name_of(const btCollisionObject& object) {
  if (const auto* collider = btMultiBodyLinkCollider::upcast(&object))
    return {collider->m_multiBody->getUserIndex2(), collider->m_link};
  return {object.getUserIndex2(), -1};
}

btCollisionObject* find_object(btDiscreteDynamicsWorld& world, const ObjectName& name) {
  auto& objects = world.getCollisionObjectArray();
  for (int k = 0; k < objects.size(); ++k) {
    const ObjectName found = name_of(*objects[k]);
    if (found.body == name.body && found.link == name.link) return objects[k];
  }
  return nullptr;
}

void require_attachable(btCollisionObject& object) {
  if (object.getInternalType() == btCollisionObject::CO_SOFT_BODY)
    throw std::invalid_argument("it is soft, and only rigid bodies and robots collide with the map");
  btRigidBody* body = btRigidBody::upcast(&object);
  for (int k = 0; body != nullptr && k < body->getNumConstraintRefs(); ++k) {
    const btTypedConstraint& joint = *body->getConstraintRef(k);
    for (const btRigidBody* joined : {&joint.getRigidBodyA(), &joint.getRigidBodyB()})
      if (joined->isInWorld() && name_of(*joined).body < 0)
        throw std::invalid_argument(
            "its links are bodies without numbers, which would fall through the map; load the robot without "
            "useMaximalCoordinates");
  }
}

btMultiBody* robot_of(btCollisionObject& object) {
  auto* collider = btMultiBodyLinkCollider::upcast(&object);
  return collider == nullptr ? nullptr : collider->m_multiBody;
}

double bounding_radius(const btCollisionObject& object) {
  btVector3 centre;
  btScalar radius;
  object.getCollisionShape()->getBoundingSphere(centre, radius);
  return centre.length() + radius;
}

double mass_of(const btCollisionObject& object) {
  if (const auto* rigid = btRigidBody::upcast(&object)) return 1.0 / rigid->getInvMass();
  const btMultiBody& body = *btMultiBodyLinkCollider::upcast(&object)->m_multiBody;
  double mass = body.getBaseMass();
  for (int link = 0; link < body.getNumLinks(); ++link) mass += body.getLink(link).m_mass;
  return mass;
}

}  // namespace smartmesh
