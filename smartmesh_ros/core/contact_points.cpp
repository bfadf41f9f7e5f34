#include "contact_points.h"

#include <algorithm>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include "bullet_convert.h"

namespace smartmesh {

namespace {

// Distance within which a contact of other features takes over impulses [m].
constexpr double MATCHING = 0.05;
// Largest distance of contacts from what Bullet keeps in a manifold [m]: none is dropped by its distance.
constexpr double FARTHEST = 1e9;

// Sets what Bullet's solver reads of the two materials, as btManifoldResult does.
void combine(const btCollisionObject& a, const btCollisionObject& b, btManifoldPoint& point) {
  point.m_combinedFriction = btManifoldResult::calculateCombinedFriction(&a, &b);
  point.m_combinedRestitution = btManifoldResult::calculateCombinedRestitution(&a, &b);
  point.m_combinedRollingFriction = btManifoldResult::calculateCombinedRollingFriction(&a, &b);
  point.m_combinedSpinningFriction = btManifoldResult::calculateCombinedSpinningFriction(&a, &b);
  const int flags = a.getCollisionFlags() | b.getCollisionFlags();
  if (flags & btCollisionObject::CF_HAS_CONTACT_STIFFNESS_DAMPING) {
    point.m_combinedContactDamping1 = btManifoldResult::calculateCombinedContactDamping(&a, &b);
    point.m_combinedContactStiffness1 = btManifoldResult::calculateCombinedContactStiffness(&a, &b);
    point.m_contactPointFlags |= BT_CONTACT_FLAG_CONTACT_STIFFNESS_DAMPING;
  }
  if (flags & btCollisionObject::CF_HAS_FRICTION_ANCHOR) point.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
}

}  // namespace

void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before) {
  before.clear();
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    const btManifoldPoint& point = manifold.getContactPoint(k);
    const bool is_first = point.m_partId0 == 0;  // the ground is body B
    const btVector3& at = is_first ? point.m_positionWorldOnB : point.m_positionWorldOnA;
    before.push_back({point.m_index0, point.m_index1, from_bullet(at), point.m_appliedImpulse,
                      {point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2}});
  }
}

void write_contacts(const std::vector<Contact>& contacts, const std::vector<OldContact>& before,
                    const btCollisionObjectWrapper& body, const btCollisionObjectWrapper& ground,
                    const Approach& approach, btPersistentManifold& manifold) {
  const btCollisionObject &mover = *body.getCollisionObject(), &base = *ground.getCollisionObject();
  const bool ground_is_b = manifold.getBody0() == &mover;
  manifold.setContactBreakingThreshold(FARTHEST);
  const int count = std::min<int>(static_cast<int>(contacts.size()), MANIFOLD_CACHE_SIZE);
  for (int k = 0; k < count; ++k) {
    const Contact& contact = contacts[k];
    const double closing = -dot(contact.normal, approach.velocity_at(contact.point));
    btVector3 on_ground = to_bullet(contact.point), on_body = to_bullet(contact.point + contact.normal * contact.distance);
    btVector3 normal = to_bullet(contact.normal);
    const btVector3 local_body = mover.getWorldTransform().invXform(on_body);
    const btVector3 local_ground = base.getWorldTransform().invXform(on_ground);
    btManifoldPoint point = ground_is_b ? btManifoldPoint(local_body, local_ground, normal, contact.distance)
                                        : btManifoldPoint(local_ground, local_body, -normal, contact.distance);
    point.m_positionWorldOnA = ground_is_b ? on_body : on_ground;
    point.m_positionWorldOnB = ground_is_b ? on_ground : on_body;
    combine(ground_is_b ? mover : base, ground_is_b ? base : mover, point);
    // A body bounces when it is there. Bullet would otherwise turn it back as far as it can come in a step.
    if (contact.distance > 0.0) {
      if (closing * approach.duration < contact.distance) point.m_combinedRestitution = 0.0;
      else if (point.m_combinedRestitution > 0.0) point.m_distance1 = 0.0;
    }
    btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
    point.m_partId0 = ground_is_b ? 0 : 1;
    point.m_index0 = contact.body_feature, point.m_index1 = contact.ground_feature;
    if (const OldContact* old = matching(contact, before, MATCHING)) {
      point.m_appliedImpulse = old->normal_impulse;
      point.m_appliedImpulseLateral1 = old->lateral_impulse[0];
      point.m_appliedImpulseLateral2 = old->lateral_impulse[1];
      point.m_lifeTime = 1;
    }
    manifold.getContactPoint(k) = point;
  }
  manifold.setNumContacts(count);
}

}  // namespace smartmesh
