#include "contact/foundation.h"

#include "contact/footprint.h"

namespace smartmesh {

namespace {

// The part of a shape below the plane of a contact, in the shape's frame. `moment` [m^4]: places weighted by their
// depths.
struct Pressed {
  double area = 0.0, volume = 0.0;
  Vec3 moment;
};

// Places of the contacts of a shape, in its frame.
struct Places {
  const Convex& shape;
  std::vector<Vec3> at;
  std::vector<DepthSample> samples;

  bool is_nearest(std::size_t k, const Vec3& p) const {
    const double own = norm2(p - at[k]);
    return std::none_of(at.begin(), at.end(), [&](const Vec3& other) { return norm2(p - other) < own; });
  }
  // Returns what contact k stands for, of the part below its plane after the shape `fell` [m].
  Pressed pressed(std::size_t k, const Vec3& normal, double fell) {
    Pressed found;
    sample_below(shape, {normal, dot(normal, at[k]) + fell}, samples);
    for (const DepthSample& sample : samples) {
      if (!is_nearest(k, sample.point)) continue;
      const double volume = sample.depth * sample.area;
      found.area += sample.area, found.volume += volume;
      found.moment = found.moment + sample.point * volume;
    }
    return found;
  }
};

}  // namespace

void lay_on_foundation(const Convex& shape, const Pose& pose, const Approach& approach, const BodySurface& body,
                       std::vector<Contact>& contacts, std::vector<ContactRow>& rows) {
  const double dt = approach.duration;
  Places places{shape, {}, {}};
  for (const Contact& contact : contacts) places.at.push_back(pose.to_local(contact.point));
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    Contact& contact = contacts[k];
    if (!contact.material.gives()) continue;
    const Vec3 normal = transposed(pose.rotation, contact.normal);
    double speed = dot(contact.normal, approach.velocity_at(contact));
    Pressed pressed = places.pressed(k, normal, -speed * dt);
    if (!(pressed.volume > 0.0)) {  // it leaves the ground, or it only comes there as gravity acts
      speed = contact.distance < 0.0 ? 0.0 : speed + dot(contact.normal, approach.gravity) * dt;
      pressed = places.pressed(k, normal, -speed * dt);
    }
    if (!(pressed.volume > 0.0)) continue;
    const double spring = contact.material.stiffness * pressed.area;
    const double share = body.is_soft ? body.stiffness / (body.stiffness + spring) : 1.0;  // of the depth in the ground
    const double damping = contact.material.damping * pressed.area + (body.is_soft ? body.damping : 0.0);
    const double force = share * contact.material.stiffness * pressed.volume, slope = share * spring * dt + damping;
    ContactRow& row = rows[k];
    const Vec3 at = pose.to_world(pressed.moment * (1.0 / pressed.volume) + normal * (speed * dt));
    const Vec3 differs = cross(contact.ground.angular, at - contact.point);  // velocity of the ground there
    const Vec3 turned = cross(approach.angular, row.at - contact.point);     // what the middle of the step differs by
    contact.ground.velocity = contact.ground.velocity + differs, row.slide = row.slide + differs - turned;
    row.at = contact.point = at, row.normal = contact.normal;
    row.speed = dot(contact.normal, contact.ground.velocity) + (force + share * spring * dt * speed) / slope;
    row.softness = std::max(1.0 / (dt * slope), norm2(body.belt) > 0.0 ? 1.0 / body.mass : 0.0) + contact.yields;
  }
}

}  // namespace smartmesh
