#include "bullet/contact_points.h"

#include <algorithm>

#include <BulletCollision/CollisionDispatch/btManifoldResult.h>
#include <BulletCollision/NarrowPhaseCollision/btPersistentManifold.h>
#include <BulletDynamics/Dynamics/btRigidBody.h>

#include "bullet/convert.h"

namespace smartmesh {

namespace {

// Largest distance of contacts from what Bullet keeps in a manifold [m]: none is dropped by its distance.
constexpr double FARTHEST = 1e9;
// Least depth that the solver is told to push a contact out of, and the most of soft contacts [m]: Bullet corrects
// deeper ones apart from their forces.
constexpr double LEAST_DEPTH = 1e-3, MOST_DEPTH = 0.03;
// Least share of anisotropic friction along an axis: the solver divides by it.
constexpr double LEAST_SHARE = 1e-6;

// Returns the point of a contact, as it is.
btManifoldPoint point_of(const Contact& contact, const Touching& touching) {
  const btTransform& body = touching.body.getWorldTransform();
  const btTransform& ground = touching.ground.getWorldTransform();
  const btVector3 on_ground = to_bullet(contact.point), normal = to_bullet(contact.normal);
  const btVector3 on_body = on_ground + normal * contact.distance;
  const btVector3 in_body = body.invXform(on_body), in_ground = ground.invXform(on_ground);
  const bool ground_is_b = touching.ground_is_b;
  btManifoldPoint point = ground_is_b ? btManifoldPoint(in_body, in_ground, normal, contact.distance)
                                      : btManifoldPoint(in_ground, in_body, -normal, contact.distance);
  point.m_positionWorldOnA = ground_is_b ? on_body : on_ground;
  point.m_positionWorldOnB = ground_is_b ? on_ground : on_body;
  point.m_partId0 = ground_is_b ? 0 : 1;
  point.m_index0 = contact.body_feature, point.m_index1 = contact.ground_feature;
  return point;
}

// Tells the solver the least speed along the normal, relative to the ground object [m/s].
void tell_speed(double speed, double softness, const Touching& touching, btManifoldPoint& point) {
  const double dt = touching.duration;
  if (softness > 0.0) {
    point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_CFM;
    point.m_contactCFM = softness * dt;
  }
  if (speed <= 0.0) {
    point.m_distance1 = -speed * dt - touching.slop;
    return;
  }
  double depth = std::max(-point.m_distance1 - touching.slop, LEAST_DEPTH);
  if (softness > 0.0) depth = std::min(depth, MOST_DEPTH);
  point.m_distance1 = -depth - touching.slop;
  point.m_contactPointFlags |= BT_CONTACT_FLAG_HAS_CONTACT_ERP;
  point.m_contactERP = speed * dt / depth;
}

// Returns a direction of friction as short as the anisotropic friction of a body makes its forces there.
btVector3 scaled(const btVector3& way, const btCollisionObject& body) {
  if (!body.hasAnisotropicFriction()) return way;
  btVector3 shares = body.getAnisotropicFriction();
  shares.setMax(btVector3(LEAST_SHARE, LEAST_SHARE, LEAST_SHARE));
  const btMatrix3x3& axes = body.getWorldTransform().getBasis();
  return axes * (way * axes * shares);
}

// Tells the solver the velocity of the ground, relative to the ground object, that friction aims at [m/s], and against
// which slip it acts.
void tell_slide(const Vec3& slide, const Slip& slip, const Vec3& normal, const Touching& touching,
                btManifoldPoint& point) {
  btVector3 &first = point.m_lateralFrictionDir1, &second = point.m_lateralFrictionDir2;
  btPlaneSpace1(point.m_normalWorldOnB, first, second);
  const btVector3 aim = to_bullet(slide);
  if (btRigidBody::upcast(&touching.body) == nullptr || btRigidBody::upcast(&touching.ground) == nullptr) {
    // As if the body held on to a point of the ground that is where its own is, and which friction pulls it to in the
    // step. The way from the ground to the body has no part in that: it is not along the normal if that is turned.
    // If the ground turns, that point has another velocity than the contact: way / time + angular velocity x way = aim.
    const btVector3 turn = to_bullet(touching.motion.angular) * touching.anchor_time;
    const btVector3 way =
        (aim + turn * turn.dot(aim) - turn.cross(aim)) * (touching.anchor_time / (1.0 + turn.length2()));
    if (way.fuzzyZero()) return;
    btVector3 &on_a = point.m_positionWorldOnA, &on_b = point.m_positionWorldOnB;
    (touching.ground_is_b ? on_b : on_a) = (touching.ground_is_b ? on_a : on_b) + way;
    point.m_contactPointFlags |= BT_CONTACT_FLAG_FRICTION_ANCHOR;
    return;
  }
  // Bullet limits friction along two directions by the same force; a shorter one makes it less. The second one is
  // across what slips.
  const Vec3 along = perpendicular(slip.along, normal);
  if (norm2(along) > 0.0) first = to_bullet(unit(along));
  first = scaled(first, touching.body);
  second = scaled(first.cross(point.m_normalWorldOnB).normalized(), touching.body) * slip.across;
  const double sign = touching.ground_is_b ? 1.0 : -1.0;
  point.m_contactMotion1 = sign * aim.dot(first), point.m_contactMotion2 = sign * aim.dot(second);
  point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
}

}  // namespace

BodySurface surface_of(const btCollisionObject& body, const btCollisionObject& ground) {
  BodySurface surface;
  surface.friction = {btManifoldResult::calculateCombinedFriction(&body, &ground),
                      btManifoldResult::calculateCombinedRollingFriction(&body, &ground),
                      btManifoldResult::calculateCombinedSpinningFriction(&body, &ground)};
  surface.restitution = btManifoldResult::calculateCombinedRestitution(&body, &ground);
  surface.is_soft = body.getCollisionFlags() & btCollisionObject::CF_HAS_CONTACT_STIFFNESS_DAMPING;
  if (surface.is_soft) {
    surface.stiffness = btManifoldResult::calculateCombinedContactStiffness(&body, &ground);
    surface.damping = btManifoldResult::calculateCombinedContactDamping(&body, &ground);
  }
  return surface;
}

void read_contacts(const btPersistentManifold& manifold, std::vector<OldContact>& before) {
  before.clear();
  for (int k = 0; k < manifold.getNumContacts(); ++k) {
    const btManifoldPoint& point = manifold.getContactPoint(k);
    const bool ground_is_b = point.m_partId0 == 0;
    const btVector3& at = ground_is_b ? point.m_positionWorldOnB : point.m_positionWorldOnA;
    const btVector3 friction = point.m_lateralFrictionDir1 * point.m_appliedImpulseLateral1 +
                               point.m_lateralFrictionDir2 * point.m_appliedImpulseLateral2;
    before.push_back({point.m_index0, point.m_index1, from_bullet(at), point.m_appliedImpulse,
                      from_bullet(ground_is_b ? friction : -friction)});
  }
}

TruePoint add_contact(const Contact& contact, const ContactRow& row, const OldContact* old, const Touching& touching,
                      btPersistentManifold& manifold) {
  const double sign = touching.ground_is_b ? 1.0 : -1.0;
  const int count = manifold.getNumContacts();
  manifold.setNumContacts(count + 1);
  manifold.setContactBreakingThreshold(FARTHEST);
  btManifoldPoint& point = manifold.getContactPoint(count) = point_of(contact, touching);
  const TruePoint is{&point, point.m_distance1, point.m_positionWorldOnA, point.m_positionWorldOnB};
  point.m_positionWorldOnA += to_bullet(row.at - contact.point);
  point.m_positionWorldOnB += to_bullet(row.at - contact.point);
  point.m_normalWorldOnB = to_bullet(row.normal * sign);
  point.m_combinedFriction = row.friction.sliding;
  point.m_combinedRollingFriction = row.friction.rolling;
  point.m_combinedSpinningFriction = row.friction.spinning;
  point.m_combinedRestitution = 0.0;  // the speed of the row has it
  const btVector3& on_ground = touching.ground_is_b ? point.m_positionWorldOnB : point.m_positionWorldOnA;
  const auto carried = [&] {
    const Vec3 arm = from_bullet(on_ground - touching.ground.getWorldTransform().getOrigin());
    return touching.motion.linear + cross(touching.motion.angular, arm);
  };
  tell_slide(row.slide - carried(), row.slip, row.normal, touching, point);
  tell_speed(row.speed - dot(row.normal, carried()), row.softness, touching, point);
  if (old == nullptr) return is;
  const btVector3 friction = to_bullet(old->friction * sign);
  point.m_appliedImpulse = old->normal_impulse;
  point.m_appliedImpulseLateral1 = friction.dot(point.m_lateralFrictionDir1);
  point.m_appliedImpulseLateral2 = friction.dot(point.m_lateralFrictionDir2) / point.m_lateralFrictionDir2.length2();
  point.m_lifeTime = 1;
  return is;
}

}  // namespace smartmesh
