// A cylinder against facets, edges and peaks: its rims are circles, its side has lines, its caps are discs.
#include <algorithm>
#include <cmath>

#include "cones.h"
#include "contact_pairs.h"
#include "triangle.h"

namespace smartmesh {

namespace {

// Sine of the angle between a cap and the ground below which four points around the cap's rim may touch, not only the
// lowest. Raising it finds the same points of a standing cylinder at a larger tilt.
constexpr double FLAT = 0.3;
// Share by which points of a rim are nearer to the middle when facets of meshes are tried, so that a facet that ends
// where the rim stands does not touch the rim.
constexpr double SHRUNK = 1e-4;
// Steps of the search for the nearest points of a rim and an edge.
constexpr int RIM_STEPS = 6;

class CylinderTouch {
 public:
  CylinderTouch(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                std::vector<Contact>& contacts)
      : shape_(shape), patch_(patch), approach_(approach), contacts_(contacts), axis_(pose.turn * shape.axis) {
    for (int k = 0; k < 2; ++k) cap_[k] = pose.at + axis_ * (k ? shape.half : -shape.half);
    const Vec3 other = std::abs(shape.axis.x) < 0.6 ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0};
    side_[0] = pose.turn * unit(cross(shape.axis, other));
    side_[1] = cross(axis_, side_[0]);
    pose_ = pose;
  }

  void run() {
    for (const Facet& facet : patch_.facets) touch_facet(facet, facet.normal, false);
    for (const Facet& facet : patch_.sheets) {
      touch_facet(facet, facet.normal, true);
      touch_facet(facet, -facet.normal, true);
    }
    for (int k = 0; k < 2; ++k) touch_flat(k);
    for (const Peak& peak : patch_.peaks) touch_peak(peak);
    const std::size_t first = contacts_.size();
    for (const Edge& edge : patch_.edges) {
      touch_side(edge);
      for (int k = 0; k < 2; ++k) touch_rim(k, edge);
    }
    if (!patch_.sheets.empty()) leave_by_nearest(first, 0.0, contacts_);
  }

 private:
  double reach_at(const Vec3& p) const {
    return approach_.margin + norm(approach_.velocity_at(p)) * approach_.duration;
  }

  void add(const Vec3& on_ground, const Vec3& n, double distance, int name, int ground) {
    if (distance <= reach_at(on_ground)) contacts_.push_back({on_ground, n, distance, name, ground});
  }

  // The lowest point of each rim over a facet, in the direction of one of its normals.
  void touch_facet(const Facet& facet, const Vec3& normal, bool is_sheet) {
    const Vec3 &a = patch_.points[facet.corner[0]], &b = patch_.points[facet.corner[1]],
               &c = patch_.points[facet.corner[2]];
    const Vec3 across = normal - axis_ * dot(normal, axis_);
    const double tilt = norm(across);
    if (tilt < 1e-6) return;  // the points around the rim will do
    for (int k = 0; k < 2; ++k) {
      const Vec3 low = cap_[k] - across * (shape_.radius / tilt);
      const double distance = dot(normal, low - a);
      const Vec3 velocity = approach_.velocity_at(low);
      if (distance > approach_.margin + norm(velocity) * approach_.duration || distance < -2.0 * shape_.reach) continue;
      const Vec3 foot = low - normal * distance;
      if (is_sheet) {
        const MovingPoint point{low + (pose_.at - low) * SHRUNK, velocity, 0.0, 0.0, pose_.at};
        if (distance < 0.0 ? !is_behind(low, facet)
                           : !comes_over(point, normal, dot(normal, point.at - a), approach_.duration, facet, patch_) ||
                                 is_hidden(low))
          continue;
      } else if (!inside_triangle(foot, a, b, c, normal, 0.0)) {
        const double closing = -dot(normal, velocity), gap = std::max(distance, 0.0);
        if (!(closing * approach_.duration > gap)) continue;
        if (!inside_triangle(foot + (velocity + normal * closing) * (gap / closing), a, b, c, normal, 0.0)) continue;
      }
      add(foot, normal, distance, name_of(BodyFeature::Rim, k),
          ground_name(patch_, facet.corner[0], facet.corner[1], facet.corner[2]));
    }
  }

  bool is_behind(const Vec3& p, const Facet& facet) const {
    double share;
    return goes_through(pose_.at, p, facet, patch_, share);
  }

  bool is_hidden(const Vec3& p) const {
    return std::any_of(patch_.sheets.begin(), patch_.sheets.end(), [&](const Facet& f) { return is_behind(p, f); });
  }

  bool is_outside(const Vec3& p) const {
    const Vec3 q = p - pose_.at;
    const double along = dot(q, axis_);
    return std::abs(along) > shape_.half || norm(q - axis_ * along) > shape_.radius;
  }

  // Four points around a rim whose cap lies nearly flat on the ground.
  void touch_flat(int k) {
    const Vec3 outward = k ? axis_ : -axis_;
    const bool on_sheet = std::any_of(patch_.sheets.begin(), patch_.sheets.end(), [&](const Facet& facet) {
      return norm(cross(outward, facet.normal)) <= FLAT;
    });
    bool on_facet = false;
    if (!patch_.facets.empty()) {
      const Vec3 up = patch_.facets[patch_.facets.size() / 2].normal;
      on_facet = dot(outward, up) <= 0.0 && norm(cross(outward, up)) <= FLAT;
    }
    if (!on_sheet && !on_facet) return;
    for (int j = 0; j < 4; ++j) {
      const Vec3 at = cap_[k] + side_[j / 2] * (j % 2 ? -shape_.radius : shape_.radius);
      const MovingPoint point{at, approach_.velocity_at(at), 0.0, reach_at(at), pose_.at};
      const int name = name_of(BodyFeature::Rim, 2 + 4 * k + j);
      if (on_facet) touch_facets(point, name, patch_, approach_.duration, contacts_);
      if (on_sheet) touch_sheets(point, name, patch_, approach_.duration, contacts_);
    }
  }

  void touch_peak(const Peak& peak) {
    const Vec3 at = patch_.points[peak.point], q = at - pose_.at;
    const double along = dot(q, axis_);
    const Vec3 across = q - axis_ * along;
    const double off = norm(across), over_cap = std::abs(along) - shape_.half, over_side = off - shape_.radius;
    const double reach = reach_at(at);
    if (over_cap > reach || over_side > reach) return;
    const int ground = ground_name(patch_, peak.point), cap = along > 0.0 ? 1 : 0;
    const Vec3 from_cap = cap ? -axis_ : axis_, from_side = off > 0.0 ? across * (-1.0 / off) : from_cap;
    const bool by_cap = in_cone(patch_, peak, from_cap), by_side = off > 1e-9 && in_cone(patch_, peak, from_side);
    if (over_cap > 0.0 && over_side > 0.0) {
      const Vec3 away = cap_[cap] - axis_ * 0.0 + across * (shape_.radius / off) - at;
      const Vec3 n = unit(away);
      if (in_cone(patch_, peak, n)) add(at, n, norm(away), name_of(BodyFeature::Rim, cap), ground);
      return;
    }
    // Inside, out by the nearer of cap and side that the ground can touch.
    const bool inside = over_cap <= 0.0 && over_side <= 0.0;
    if (by_cap && over_side <= 0.0 && (!inside || !by_side || over_cap >= over_side))
      add(at, from_cap, over_cap, name_of(BodyFeature::Face, cap), ground);
    else if (by_side && over_cap <= 0.0)
      add(at, from_side, over_side, name_of(BodyFeature::Side, 0), ground);
  }

  // The line along the side that is nearest to an edge.
  void touch_side(const Edge& edge) {
    const Vec3 &p = patch_.points[edge.end[0]], &q = patch_.points[edge.end[1]];
    double s, t;
    if (!nearest_on_lines(cap_[0], cap_[1], p, q, s, t) || !(s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0)) return;
    Vec3 n = unit(cross(axis_, q - p));
    const Vec3 on_ground = p + (q - p) * t;
    const Vec3 outward = edge.is_of_mesh() ? cap_[0] + (cap_[1] - cap_[0]) * s - on_ground : edge.outward;
    if (dot(n, outward) < 0.0) n = -n;
    const double distance = dot(n, cap_[0] + (cap_[1] - cap_[0]) * s - on_ground) - shape_.radius;
    if (distance > reach_at(on_ground) || distance < -shape_.radius || !in_cone(patch_, edge, n)) return;
    add(on_ground, n, distance, name_of(BodyFeature::Side, 1), ground_name(patch_, edge.end[0], edge.end[1]));
  }

  // A rim and an edge that cross: the tangent of the rim and the edge span a plane that holds both apart.
  void touch_rim(int k, const Edge& edge) {
    const Vec3 &p = patch_.points[edge.end[0]], &q = patch_.points[edge.end[1]];
    const Vec3 outward = k ? axis_ : -axis_;
    double t = std::clamp(along_segment(cap_[k], p, q), 0.0, 1.0);
    if (norm(p + (q - p) * t - cap_[k]) > shape_.radius + reach_at(cap_[k]) + norm(approach_.angular) * shape_.radius *
                                                                                  approach_.duration)
      return;
    // The search starts where the edge crosses the side seen along the axis, or is nearest to it.
    const Vec3 from = p - cap_[k], way = q - p, w = from - axis_ * dot(from, axis_), u = way - axis_ * dot(way, axis_);
    const double uu = norm2(u), uw = dot(u, w), root = uw * uw - uu * (norm2(w) - shape_.radius * shape_.radius);
    const double middle = uu > 0.0 ? -uw / uu : 0.0, aside = uu > 0.0 && root > 0.0 ? std::sqrt(root) / uu : 0.0;
    touch_rim_from(k, edge, p, q, outward, middle - aside);
    if (aside > 0.0) touch_rim_from(k, edge, p, q, outward, middle + aside);
  }

  void touch_rim_from(int k, const Edge& edge, const Vec3& p, const Vec3& q, const Vec3& outward, double t) {
    double s = 0.0;
    Vec3 on_rim, tangent;
    for (int step = 0; step < RIM_STEPS; ++step) {
      const Vec3 e = p + (q - p) * std::clamp(t, 0.0, 1.0) - cap_[k];
      const Vec3 across = e - axis_ * dot(e, axis_);
      const double off = norm(across);
      if (off < 1e-9) return;
      on_rim = cap_[k] + across * (shape_.radius / off);
      tangent = cross(axis_, across * (1.0 / off));
      if (!nearest_on_lines(on_rim, on_rim + tangent, p, q, s, t)) return;
    }
    if (!(t > 0.0 && t < 1.0) || std::abs(s) > 1e-3 * shape_.radius) return;
    Vec3 n = unit(cross(tangent, q - p));
    // The rim is touched from directions between those of its cap and of its side.
    const Vec3 radial = cross(tangent, axis_);
    if (dot(n, edge.is_of_mesh() ? -outward - radial : edge.outward) < 0.0) n = -n;
    if (dot(n, outward) > 0.0 || dot(n, radial) > 0.0 || !in_cone(patch_, edge, n)) return;
    const Vec3 on_ground = p + (q - p) * t;
    const double distance = dot(n, on_rim - on_ground);
    if (distance < -shape_.radius || (distance < 0.0 && edge.is_of_mesh() && is_outside(on_ground))) return;
    add(on_ground, n, distance, name_of(BodyFeature::Rim, k), ground_name(patch_, edge.end[0], edge.end[1]));
  }

  const Convex& shape_;
  const Patch& patch_;
  const Approach& approach_;
  std::vector<Contact>& contacts_;
  Vec3 axis_, cap_[2], side_[2];
  Pose pose_;
};

}  // namespace

void touch_cylinder(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach,
                    std::vector<Contact>& contacts) {
  CylinderTouch(shape, pose, patch, approach, contacts).run();
}

}  // namespace smartmesh
