// A cylinder against facets, edges and peaks: its rims are circles, its side has lines, its caps are discs.
#include <algorithm>
#include <cmath>

#include "contact/cones.h"
#include "contact/contact_pairs.h"
#include "math/triangle.h"

namespace smartmesh {

namespace {

// Cosine of the angle between a cap and the ground below which four points around the cap's rim may touch, not only the
// lowest. Lowering it finds the same points of a standing cylinder at a larger tilt.
constexpr double FLAT = 0.95;
// Steps of the search for the nearest point of an ellipse.
constexpr int ELLIPSE_STEPS = 40;

// Finds the point of the quarter (r cos, r narrow sin), angles from 0 to a right one, of an ellipse at which the
// distance from the point (x, y), x >= 0, is least. False if there is none between other quarters.
bool nearest_on_ellipse(double r, double narrow, double x, double y, double& angle) {
  const double bend = r * (1.0 - narrow * narrow);
  double low = 0.0, high = 0.5 * M_PI;
  if (y < 0.0) {  // between two extremes, or none beyond the evolute
    const double ratio = std::cbrt(-y * narrow / std::max(x, 1e-300));
    low = std::atan(ratio);
    if (x * std::sin(low) - y * narrow * std::cos(low) >= bend * std::sin(low) * std::cos(low)) return false;
  }
  angle = 0.5 * (low + high);
  for (int step = 0; step < ELLIPSE_STEPS; ++step) {  // Newton's method, halving where it would leave the bracket
    const double s = std::sin(angle), c = std::cos(angle);
    const double slope = x * s - y * narrow * c - bend * s * c;
    (slope < 0.0 ? low : high) = angle;
    const double curve = x * c + y * narrow * s - bend * (c * c - s * s);
    double next = angle - slope / curve;
    if (!(curve > 0.0 && next > low && next < high)) next = 0.5 * (low + high);
    const bool done = std::abs(next - angle) < 1e-14;
    angle = next;
    if (done) break;
  }
  return true;
}

class CylinderTouch {
 public:
  CylinderTouch(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts)
      : shape_(shape),
        patch_(patch),
        approach_(approach),
        contacts_(contacts),
        radius_(shape.half.x),
        axis_(pose.rotation * Vec3{0.0, 0.0, 1.0}),
        spin_(norm(approach.angular) * shape.half.x * approach.duration),
        pose_(pose) {
    for (int k = 0; k < 2; ++k) cap_[k] = pose.at + axis_ * (k ? shape.half.z : -shape.half.z);
    side_[0] = pose.rotation * Vec3{0.0, 1.0, 0.0};
    side_[1] = cross(axis_, side_[0]);
    middle_ = approach.velocity_at(pose.at);
    tips_ = perpendicular(approach.angular, axis_), tilting_ = tips_ * approach.duration;
  }

  void run() {
    for (const Facet& facet : patch_.facets)
      touch_facet(facet, patch_.is_mesh ? normal_towards(pose_.at, facet, patch_) : facet.normal);
    for (int k = 0; k < 2; ++k) touch_flat(k);
    for (const Peak& peak : patch_.peaks) touch_peak(peak);
    for (const Edge& edge : patch_.edges) {
      touch_side(edge);
      for (int k = 0; k < 2; ++k) touch_rim(k, edge);
    }
  }

 private:
  double contact_distance_at(const Vec3& p) const { return approach_.contact_distance(approach_.velocity_at(p)); }

  void add(const Vec3& on_ground, const Vec3& n, double distance, int name, int ground,
           NormalOf normal_of = NormalOf::Ground, const Edge* edge = nullptr) {
    if (distance > contact_distance_at(on_ground)) return;
    contacts_.push_back({on_ground, n, distance, name, ground});
    contacts_.back().normal_of = normal_of;
    if (edge == nullptr) return;
    contacts_.back().body_edge = axis_;
    contacts_.back().ground_edge = unit(patch_.points[edge->end[1]] - patch_.points[edge->end[0]]);
    contacts_.back().ground_turn = patch_.turn_of(*edge);
  }

  // The point of each rim that is lowest over a facet, in the direction of its normal to the side of the cylinder, the
  // one that will be lowest at the end of the step, and the one that the cylinder may tip over to in the step.
  void touch_facet(const Facet& facet, const Vec3& normal) {
    touch_facet(facet, normal, normal, 0);
    if (norm(tilting_) * radius_ > approach_.margin) touch_facet(facet, normal, normal - cross(tilting_, normal), 10);
    const double along = dot(normal, axis_);
    if (std::abs(along) > std::cos(approach_.angle_after_impact(normal)))
      touch_facet(facet, normal, axis_ * (2.0 * along) - normal, 20);
  }

  // `seen`: the normal in the frame of the cylinder. `name`: of the first rim.
  void touch_facet(const Facet& facet, const Vec3& normal, const Vec3& seen, int name) {
    const Vec3 across = perpendicular(seen, axis_);
    const double tilt = norm(across);
    if (tilt < 1e-6) return;  // the points around the rim will do
    for (int k = 0; k < 2; ++k)
      touch_point(facet, normal, cap_[k] - across * (radius_ / tilt), name_of(BodyFeature::Rim, name + k));
  }

  // A point of a rim against a facet. It stays where it is when the cylinder spins about its axis.
  void touch_point(const Facet& facet, const Vec3& normal, const Vec3& low, int name) {
    const Vec3 &a = patch_.points[facet.corner[0]], &b = patch_.points[facet.corner[1]],
               &c = patch_.points[facet.corner[2]];
    const double distance = dot(normal, low - a), contact_distance = contact_distance_at(low);
    if (distance > contact_distance || distance < -2.0 * shape_.bounding_radius) return;
    const MovingPoint point{low, middle_ + cross(tips_, low - pose_.at), 0.0, contact_distance, pose_.at};
    const Vec3 projected = low - normal * distance;
    if (distance < 0.0) {
      if (inside_triangle(projected, a, b, c, facet.normal, 0.0) || is_over(low, a, b, c)) touch_all(point, name);
      return;
    }
    if (!comes_over(point, normal, distance, approach_.duration, 0.0, facet, patch_)) return;
    if (patch_.is_mesh && !is_outermost(facet, low)) return;
    add(projected, normal, distance, name, ground_name(patch_, facet));
  }

  // Returns true if no other facet of a mesh hides this one: the way to `p` goes through none.
  bool is_outermost(const Facet& facet, const Vec3& p) const {
    const Facet* passed = penetrated(pose_.at, p, patch_);
    return passed == nullptr || passed == &facet;
  }

  // A point of a rim against all facets.
  void touch_all(const MovingPoint& point, int name) {
    const auto touch = patch_.is_mesh ? touch_sheets : touch_facets;
    touch(point, name, patch_, approach_.duration, contacts_);
  }

  // Four points around a rim whose cap lies nearly flat on the ground.
  void touch_flat(int k) {
    const Vec3 outward = k ? axis_ : -axis_;
    const auto is_flat = [&](const Facet& facet) {
      const double facing = -dot(outward, facet.normal);
      return (patch_.is_mesh ? std::abs(facing) : facing) >= FLAT;
    };
    if (std::none_of(patch_.facets.begin(), patch_.facets.end(), is_flat)) return;
    for (int j = 0; j < 4; ++j) {
      const Vec3 at = cap_[k] + side_[j / 2] * (j % 2 ? -radius_ : radius_);
      touch_all({at, approach_.velocity_at(at), 0.0, contact_distance_at(at), pose_.at},
                name_of(BodyFeature::Rim, 2 + 4 * k + j));
    }
  }

  void touch_peak(const Peak& peak) {
    const Vec3 at = patch_.points[peak.point], q = at - pose_.at;
    const double along = dot(q, axis_);
    const Vec3 across = q - axis_ * along;
    const double off = norm(across), over_cap = std::abs(along) - shape_.half.z, over_side = off - radius_;
    const double contact_distance = contact_distance_at(at);
    if (over_cap > contact_distance || over_side > contact_distance) return;
    const int ground = ground_name(patch_, peak.point), cap = along > 0.0 ? 1 : 0;
    const Vec3 from_cap = cap ? -axis_ : axis_, from_side = off > 0.0 ? across * (-1.0 / off) : from_cap;
    const bool by_cap = in_cone(patch_, peak, from_cap, cone_slack(approach_, from_cap, over_cap, SEAT));
    const bool by_side =
        off > 1e-9 && in_cone(patch_, peak, from_side, cone_slack(approach_, from_side, over_side, SEAT));
    if (over_cap > 0.0 && over_side > 0.0) {
      const Vec3 away = cap_[cap] + across * (radius_ / off) - at;
      const Vec3 n = unit(away);
      if (in_cone(patch_, peak, n, cone_slack(approach_, n, 1.0)))
        add(at, n, norm(away), name_of(BodyFeature::Rim, cap), ground);
      return;
    }
    // Inside, out by the nearer of cap and side that the ground can touch, if the other is not much nearer.
    const bool inside = over_cap <= 0.0 && over_side <= 0.0;
    const auto is_way = [&](double distance) {
      return !inside || std::max(over_cap, over_side) <= MUCH_SHORTER * distance;
    };
    if (by_cap && over_side <= 0.0 && (!inside || !by_side || over_cap >= over_side)) {
      if (is_way(over_cap)) add(at, from_cap, over_cap, name_of(BodyFeature::Face, cap), ground, NormalOf::Body);
    } else if (by_side && over_cap <= 0.0 && is_way(over_side)) {
      add(at, from_side, over_side, name_of(BodyFeature::Side, 0), ground);
    }
  }

  // The line along the side that is nearest to an edge.
  void touch_side(const Edge& edge) {
    const Vec3 &p = patch_.points[edge.end[0]], &q = patch_.points[edge.end[1]];
    double s, t;
    if (!nearest_on_lines(cap_[0], cap_[1], p, q, s, t) || !(s > 0.0 && s < 1.0)) return;
    Vec3 n = unit(cross(axis_, q - p));
    const Vec3 on_ground = p + (q - p) * std::clamp(t, 0.0, 1.0),
               from_axis = cap_[0] + (cap_[1] - cap_[0]) * s - on_ground;
    if (dot(n, patch_.is_mesh ? from_axis : edge.outward) < 0.0) n = -n;
    const double distance = dot(n, from_axis) - radius_;
    if (distance > contact_distance_at(on_ground) || !is_on_edge(t, distance) ||
        !in_cone(patch_, edge, n, cone_slack(approach_, n, distance)))
      return;
    if (distance < 0.0 && !is_shortest(shape_, pose_, patch_, edge, t, n, distance)) return;
    add(on_ground, n, distance, name_of(BodyFeature::Side, 1), ground_name(patch_, edge.end[0], edge.end[1]),
        NormalOf::Edges, &edge);
  }

  // Seen along an edge, a rim is an ellipse and the edge a point; only the half of the ellipse beyond the cap counts.
  void touch_rim(int k, const Edge& edge) {
    const Vec3 &p = patch_.points[edge.end[0]], &q = patch_.points[edge.end[1]];
    const double t = std::clamp(along_segment(cap_[k], p, q), 0.0, 1.0),
                 contact_distance = contact_distance_at(cap_[k]) + spin_;
    if (norm(p + (q - p) * t - cap_[k]) > radius_ + contact_distance) return;
    const Vec3 along = unit(q - p), outward = k ? axis_ : -axis_, to_edge = p - cap_[k];
    Vec3 wide = cross(outward, along);
    const double narrow = std::abs(dot(axis_, along)), r = radius_;  // half axes of the ellipse: r, r * narrow
    if (norm(wide) < CONE_TOLERANCE) {                               // the edge lies along the side
      const Vec3 across = perpendicular(to_edge, axis_);
      if (norm(across) > 1e-9) add_rim(k, edge, unit(across), -unit(across));
      return;
    }
    wide = unit(wide);
    if (dot(wide, to_edge) < 0.0) wide = -wide;
    Vec3 up = cross(outward, wide), high = cross(along, wide);  // in the plane of the rim, and across the edge
    if (dot(high, outward) < 0.0) high = -high;
    if (dot(up, high) < 0.0) up = -up;
    const double x = dot(to_edge, wide), y = dot(to_edge, high);
    double angle;
    if (x > r + contact_distance || y > r * narrow + contact_distance || !nearest_on_ellipse(r, narrow, x, y, angle))
      return;
    const double c = std::cos(angle), s = std::sin(angle);
    const double dx = x - r * c, dy = y - r * narrow * s;
    Vec3 n = -unit(wide * (narrow * c) + high * s);
    const bool outside = narrow * c * dx + s * dy > 0.0, is_clear = std::hypot(dx, dy) > 1e-9;
    if (is_clear && (outside || narrow * c + s < 1e-9)) n = -unit(wide * dx + high * dy);
    add_rim(k, edge, wide * c + up * s, n);
    // An edge across the cap crosses its rim twice.
    if (narrow < SEAT) add_rim(k, edge, wide * c - up * s, n);
  }

  // `radial`: direction of the point of the rim from its centre.
  void add_rim(int k, const Edge& edge, const Vec3& radial, const Vec3& n) {
    const Vec3 &p = patch_.points[edge.end[0]], &q = patch_.points[edge.end[1]];
    const Vec3 on_rim = cap_[k] + radial * radius_;
    const double t = along_segment(on_rim, p, q);
    const Vec3 on_ground = p + (q - p) * std::clamp(t, 0.0, 1.0);
    const double distance = dot(n, on_rim - on_ground);
    if (!is_on_edge(t, distance) || !in_cone(patch_, edge, n, cone_slack(approach_, n, distance, SEAT))) return;
    if (distance < 0.0 && !is_shortest(shape_, pose_, patch_, edge, t, n, distance)) return;
    add(on_ground, n, distance, name_of(BodyFeature::Rim, k), ground_name(patch_, edge.end[0], edge.end[1]));
  }

  const Convex& shape_;
  const Patch& patch_;
  const Approach& approach_;
  std::vector<Contact>& contacts_;
  double radius_;
  Vec3 axis_, cap_[2], side_[2];
  Vec3 middle_, tips_;  // velocity of the middle [m/s], angular velocity without the spin about the axis [rad/s]
  Vec3 tilting_;        // rotation of the axis in the step [rad]
  double spin_;         // way that turning may move a point of a rim relative to its centre [m]
  Pose pose_;
};

}  // namespace

void touch_cylinder(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                    std::vector<Contact>& contacts) {
  CylinderTouch(shape, pose, patch, approach, contacts).run();
}

}  // namespace smartmesh
