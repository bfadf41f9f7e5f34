#include "contact_points.h"

#include <algorithm>
#include <cmath>

#include <BulletCollision/CollisionDispatch/btCollisionObjectWrapper.h>
#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>

#include "convert.h"

namespace smartmesh {

namespace {

// Distance within which a contact of other features takes over impulses [m].
constexpr double MATCHING = 0.05;
// Largest distance of contacts from what Bullet keeps in a manifold [m]: none is dropped by its distance.
constexpr double FARTHEST = 1e9;
// Largest speed at which a body that is inside the ground is pushed out [m/s].
constexpr double PUSH_OUT = 1.0;
// Shortest time in which it is pushed out [s]: a share of its depth in each step, however short the step, would throw
// bodies the higher, the shorter the steps.
constexpr double PUSH_OUT_TIME = 0.014;

// Sine of the angle between a belt's axis and a normal, below which the contact is at the side of the belt and stands still.
constexpr double SIDE = 0.5;

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

// Sets how a contact bounces. The solver turns a body back as soon as it would reach the ground within the step, at a
// distance d above it. From there it must not rise higher than from the ground: v'^2 / 2g + v' dt / 2 + d, in the
// solver's steps, equals e^2 (v^2 + 2 g d) / 2g.
double restitution_of(const Contact& contact, const Approach& approach, double restitution) {
  const double closing = -dot(contact.normal, approach.velocity_at(contact.point)), d = contact.distance;
  if (restitution == 0.0 || closing <= 0.0 || closing * approach.duration < d) return 0.0;
  const double g = std::max(0.0, -dot(approach.gravity, contact.normal)), half = 0.5 * g * approach.duration;
  const double e2 = restitution * restitution;
  const double square = half * half + e2 * closing * closing - 2.0 * g * d * (1.0 - e2);
  return square > 0.0 ? std::max(0.0, (std::sqrt(square) - half) / closing) : 0.0;
}

btManifoldPoint point_of(const Contact& contact, const Touching& touching, bool ground_is_b) {
  const btCollisionObject& body = *touching.body.getCollisionObject();
  const btCollisionObject& ground = *touching.ground.getCollisionObject();
  const btVector3 on_ground = to_bullet(contact.point), normal = to_bullet(contact.normal);
  const btVector3 on_body = on_ground + normal * contact.distance;
  const btVector3 local_body = body.getWorldTransform().invXform(on_body);
  const btVector3 local_ground = ground.getWorldTransform().invXform(on_ground);
  btManifoldPoint point = ground_is_b ? btManifoldPoint(local_body, local_ground, normal, contact.distance)
                                      : btManifoldPoint(local_ground, local_body, -normal, contact.distance);
  point.m_positionWorldOnA = ground_is_b ? on_body : on_ground;
  point.m_positionWorldOnB = ground_is_b ? on_ground : on_body;
  combine(ground_is_b ? body : ground, ground_is_b ? ground : body, point);
  point.m_combinedFriction *= contact.friction;
  point.m_combinedRestitution = restitution_of(contact, touching.approach, point.m_combinedRestitution);
  if (point.m_combinedRestitution > 0.0) point.m_distance1 = std::min(0.0, contact.distance);  // it bounces now
  if (contact.distance < 0.0) {
    const double duration = touching.approach.duration;
    point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_ERP;
    point.m_contactERP = std::min({touching.erp, duration / PUSH_OUT_TIME, PUSH_OUT * duration / -contact.distance});
  }
  if (touching.softness > 0.0) {
    point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_CFM;
    point.m_contactCFM = touching.softness;
  }
  btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
  if (norm2(touching.belt) > 0.0)
    run_on(surface_velocity(touching.belt, contact.normal) * touching.anchor_time, ground_is_b, point);
  point.m_partId0 = ground_is_b ? 0 : 1;
  point.m_index0 = contact.body_feature, point.m_index1 = contact.ground_feature;
  return point;
}

}  // namespace

Vec3 surface_velocity(const Vec3& belt, const Vec3& normal) {
  const Vec3 along = cross(belt, normal);
  const double speed = norm(belt), share = norm(along) / speed;
  return share > SIDE ? along * (1.0 / share) : Vec3{};
}

void run_on(const Vec3& ahead, bool ground_is_b, btManifoldPoint& point) {
  // As if the body held on to a point of the ground, which friction pulls it to in the step.
  (ground_is_b ? point.m_positionWorldOnB : point.m_positionWorldOnA) += to_bullet(ahead);
  point.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
}

void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before) {
  before.clear();
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    const btManifoldPoint& point = manifold.getContactPoint(k);
    const bool is_first = point.m_partId0 == 0;  // the ground is body B
    const btVector3& at = is_first ? point.m_positionWorldOnB : point.m_positionWorldOnA;
    before.push_back({point.m_index0, point.m_index1, from_bullet(at), point.m_appliedImpulse,
                      {point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2},
                      {from_bullet(point.m_lateralFrictionDir1), from_bullet(point.m_lateralFrictionDir2)}});
  }
}

void write_contacts(const std::vector<Contact>& contacts, const std::vector<OldContact>& before,
                    const Touching& touching, btPersistentManifold& manifold) {
  const bool ground_is_b = manifold.getBody0() == touching.body.getCollisionObject();
  manifold.setContactBreakingThreshold(FARTHEST);
  const int count = std::min<int>(static_cast<int>(contacts.size()), MANIFOLD_CACHE_SIZE);
  for (int k = 0; k < count; ++k) {
    btManifoldPoint point = point_of(contacts[k], touching, ground_is_b);
    if (const OldContact* old = matching(contacts[k], before, MATCHING)) {
      point.m_appliedImpulse = old->normal_impulse;
      point.m_appliedImpulseLateral1 = old->lateral_impulse[0];
      point.m_appliedImpulseLateral2 = old->lateral_impulse[1];
      // The solver chooses directions anew, but not in the step in which a body falls asleep.
      point.m_lateralFrictionDir1 = to_bullet(old->lateral[0]), point.m_lateralFrictionDir2 = to_bullet(old->lateral[1]);
      point.m_lifeTime = 1;
    }
    manifold.getContactPoint(k) = point;
  }
  manifold.setNumContacts(count);
}

void put_back_places(btPersistentManifold& manifold, bool ground_is_b) {
  const btTransform& ground = (ground_is_b ? manifold.getBody1() : manifold.getBody0())->getWorldTransform();
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    btManifoldPoint& point = manifold.getContactPoint(k);
    if (ground_is_b)
      point.m_positionWorldOnB = ground * point.m_localPointB;
    else
      point.m_positionWorldOnA = ground * point.m_localPointA;
  }
}

}  // namespace smartmesh
