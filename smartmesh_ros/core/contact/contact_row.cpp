#include "contact/contact_row.h"

#include <algorithm>
#include <cmath>

#include "math/triangle.h"

namespace smartmesh {

namespace {

// Largest speed at which a body that is inside the ground is pushed out [m/s].
constexpr double PUSH_OUT = 1.0;
// Shortest time in which it is pushed out [s]: a share of its depth in each step, however short the step, would throw
// bodies the higher, the shorter the steps.
constexpr double PUSH_OUT_TIME = 0.014;
// Sine of the angle between a belt's axis and a normal, below which the contact is at the side of the belt and stands
// still.
constexpr double SIDE = 0.5;
// Least share of friction across the slip: solvers divide by its square.
constexpr double LEAST_ACROSS = 0.01;
// A slip has a direction if it is faster than rounding makes it [m/s], and than this share of what friction can stop in
// a step: below it, the next push may come from anywhere.
constexpr double SLOWEST_SLIP = 1e-7, LEAST_HELD = 0.1;

// Returns what the friction of a contact in the last step leaves of the cone across its direction, as a share of the
// most, if an `impact` [N s] comes to what the contact carried then.
double across_slip(const OldContact* old, double friction, double impact) {
  if (old == nullptr || !(friction * old->normal_impulse > 0.0)) return 1.0;
  const double used = norm(old->friction) / (friction * (old->normal_impulse + impact));
  return std::sqrt(std::max(1.0 - used * used, LEAST_ACROSS * LEAST_ACROSS));
}

// Returns the speed at which a body leaves the ground that it reaches in the step, zero if it does not bounce. The
// solver turns a body back as soon as it would reach the ground within the step, at a distance d above it. From there
// it must not rise higher than from the ground: v'^2 / 2g + v' dt / 2 + d, in the solver's steps, equals e^2 (v^2 + 2 g
// d) / 2g.
double bounce_of(const Contact& contact, const ContactRow& row, const Approach& approach, double restitution,
                 double slowest) {
  // The speed at the place of the row, which the solver turns back: that of another place would gain or lose energy.
  const Vec3 velocity = approach.velocity_at(row.at) + approach.ground - contact.ground.velocity;
  const double closing = -dot(row.normal, velocity), d = contact.distance;
  if (restitution == 0.0 || closing <= slowest || closing * approach.duration < d) return 0.0;
  const double g = std::max(0.0, -dot(approach.gravity, row.normal)), half = 0.5 * g * approach.duration;
  const double e2 = restitution * restitution;
  const double square = half * half + e2 * closing * closing - 2.0 * g * d * (1.0 - e2);
  return square > 0.0 ? std::max(0.0, std::sqrt(square) - half) : 0.0;
}

// Returns the speed along the normal, relative to the ground, that corrects a distance [m] in the step.
double correcting(double distance, double duration, const Correction& solver) {
  const double gap = distance + solver.slop;
  if (gap >= 0.0) return -gap / duration;
  return std::min(-gap * std::min(solver.erp / duration, 1.0 / PUSH_OUT_TIME), PUSH_OUT);
}

// Moves the row of a contact whose normal turns with the shape: a face of the shape slides over a point of the ground,
// or an edge over an edge, and turns.
void slide_to_mid_step(const Convex& shape, const Contact& contact, const Approach& approach, ContactRow& row) {
  const double half = 0.5 * approach.duration;
  const Vec3& n = contact.normal;
  const auto slid = [&](const Vec3& p) {  // way of a point of the shape along the ground until then
    return perpendicular(approach.velocity_at(p) + approach.ground - contact.ground.velocity, n) * half;
  };
  const auto rotated = [&](const Vec3& way) { return way + cross(approach.angular, way) * half; };
  Vec3 at = contact.point, normal = rotated(n);
  if (contact.normal_of == NormalOf::Edges) {
    const Vec3 on_core = contact.point + n * (contact.distance + shape.rounding), then = on_core + slid(on_core);
    const Vec3 edge = rotated(contact.body_edge), other = contact.ground_edge + contact.ground_turn * half;
    double s, t;
    if (!nearest_on_lines(then, then + edge, at, at + other, s, t)) return;
    at = at + other * t, normal = cross(edge, other);
    if (norm(at - approach.centre) > shape.bounding_radius) return;  // they cross no more
    if (dot(normal, n) < 0.0) normal = -normal;
  }
  row.at = at - slid(approach.centre), row.normal = unit(normal);
}

// Moves the places and normals of the rows of a shape at `pose` to those of the middle of the step, relative to its
// centre there.
void place_in_mid_step(const Convex& shape, const Pose& pose, const std::vector<Contact>& contacts,
                       const Approach& approach, std::vector<ContactRow>& rows) {
  // The solver takes the velocity of a contact for all of the step: that of the middle is right to second order. A
  // point of a body that turns moves along an arc.
  const bool is_round = shape.kind == ShapeKind::Cylinder || shape.kind == ShapeKind::Capsule;
  const Vec3 axis = pose.rotation * Vec3{0.0, 0.0, 1.0};
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    if (contact.normal_of != NormalOf::Ground) {
      slide_to_mid_step(shape, contact, approach, rows[k]);
      continue;
    }
    const Vec3 on_core = contact.point + contact.normal * (contact.distance + shape.rounding);
    const Vec3 arm = (on_core - approach.centre) * (0.5 * approach.duration);
    // Along the ground all move as in the middle of the step. Along the normal, what is in the ground stays there, and
    // so does the surface of a round shape that spins: only what tilts its axis in the plane of the normal moves it.
    Vec3 angular = contact.distance > 0.0 ? approach.angular : Vec3{};
    if (const Vec3 tilts = unit(cross(contact.normal, axis)); is_round) angular = tilts * dot(angular, tilts);
    rows[k].at = contact.point + cross(angular, arm);
    rows[k].slide = rows[k].slide - cross(approach.angular, cross(approach.angular - angular, arm));
  }
}

// Sets what a row in its place brings about along the normal, and the velocity of a belt.
void set_speeds(const Contact& contact, const Approach& approach, const BodySurface& body, const Correction& solver,
                ContactRow& row) {
  const double dt = approach.duration, stiffness = body.stiffness;
  const double bounce =
      bounce_of(contact, row, approach, body.restitution * contact.material.restitution, solver.slowest_bounce);
  const double distance = bounce > 0.0 ? std::min(0.0, contact.distance) : contact.distance;
  // Of a spring, the force is that of its depth and its speed at the end of the step.
  const double leaves = body.is_soft && distance < 0.0 ? -distance * stiffness / (dt * stiffness + body.damping)
                                                       : correcting(distance, dt, solver);
  // What bounces out of the ground needs no push besides: the sum would gain energy.
  row.speed = dot(row.normal, contact.ground.velocity) + (bounce > 0.0 ? std::max(bounce, leaves) : leaves);
  if (body.is_soft) row.softness = 1.0 / (dt * (dt * stiffness + body.damping));
  if (norm2(body.belt) > 0.0) {
    row.slide = row.slide + surface_velocity(body.belt, contact.normal);
    // Rigid contacts may share a load in any way. These share it as equal springs, 0.1 mm deep at 240 Hz.
    row.softness = std::max(row.softness, 1.0 / body.mass);
  }
}

}  // namespace

void find_rows(const Convex& shape, const Pose& pose, const std::vector<Contact>& contacts, const Approach& approach,
               const BodySurface& body, const Correction& solver, std::vector<ContactRow>& rows) {
  rows.clear();
  for (const Contact& contact : contacts) {
    ContactRow& row = rows.emplace_back();
    row.at = contact.point, row.normal = contact.normal, row.slide = contact.ground.velocity;
    row.friction = body.friction;
    row.friction.sliding *= contact.material.friction;
  }
  place_in_mid_step(shape, pose, contacts, approach, rows);
  for (std::size_t k = 0; k < contacts.size(); ++k) set_speeds(contacts[k], approach, body, solver, rows[k]);
}

Vec3 surface_velocity(const Vec3& belt, const Vec3& normal) {
  const Vec3 along = cross(belt, normal);
  const double speed = norm(belt), share = norm(along) / speed;
  return share > SIDE ? along * (1.0 / share) : Vec3{};
}

void resist_rolling(const std::vector<Contact>& contacts, const Approach& approach, const Vec3& pull,
                    std::vector<ContactRow>& rows) {
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    const double radius = dot(approach.centre - contact.point, contact.normal);
    const double most = contact.material.rolling * radius;
    if (!(most > 0.0)) continue;
    const Vec3 rolls = cross(approach.angular - contact.ground.angular, contact.normal * radius) + pull,
               along = perpendicular(rolls, contact.normal);
    const double speed = norm(along), falls = -dot(approach.gravity, contact.normal) * approach.duration;
    if (!(speed > 0.0)) continue;
    // What carries the weight of the body there stops it in the step.
    const Vec3 ahead = along * ((falls > 0.0 ? std::min(most, radius * speed / falls) : most) / speed);
    rows[k].at = rows[k].at + ahead;
    // There it turns as the body does: a spin about the normal makes no slip.
    const Vec3 turns = cross(approach.angular, ahead);
    rows[k].speed += dot(contact.normal, turns), rows[k].slide = rows[k].slide + turns;
  }
}

void find_slips(const std::vector<Contact>& contacts, const std::vector<OldContact>& before, const Approach& approach,
                const Vec3& pull, const Vec3& last_pull, double mass, std::vector<ContactRow>& rows) {
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    const OldContact* old = matching(contact, before, approach.duration);
    const double friction = rows[k].friction.sliding, share = static_cast<double>(contacts.size()) / mass;
    const Vec3 velocity = approach.velocity_at(rows[k].at) + approach.ground,
               slip = perpendicular(velocity - rows[k].slide, contact.normal);
    // Without friction, what does not slip would go where friction held it in the last step, and where it is pulled
    // since.
    const bool slips = old == nullptr || norm2(slip) > norm2(pull);
    const Vec3 pulled = slips ? pull : pull - last_pull - old->friction * share,
               along = slip + perpendicular(pulled, contact.normal);
    const double holds = old == nullptr ? 0.0 : friction * old->normal_impulse * share;
    const double closing = rows[k].speed - dot(rows[k].normal, velocity) - norm(pull);           // without gravity
    const double impact = rows[k].softness > 0.0 ? 0.0 : rows[k].mass * std::max(0.0, closing);  // springs have none
    if (norm(along) > SLOWEST_SLIP + LEAST_HELD * holds) rows[k].slip = {along, across_slip(old, friction, impact)};
  }
}

}  // namespace smartmesh
