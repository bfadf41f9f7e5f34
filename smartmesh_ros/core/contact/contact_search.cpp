#include "contact/contact_search.h"

#include <algorithm>
#include <cmath>

#include "contact/cones.h"
#include "contact/contact_pairs.h"

namespace smartmesh {

namespace {

// Part of the ground that a shape may touch in the step: around its box, grown by the way it may come.
class ShapeReach final : public Reach {
 public:
  ShapeReach(const Convex& shape, const Pose& pose, double grown, double bottom, double depth)
      : shape_(shape),
        pose_(pose),
        centre_(pose.to_world(shape.centre)),
        grown_(grown),
        bottom_(bottom),
        depth_(depth) {
    is_ball_ = shape.core.vertices.size() == 1;
  }

  bool touches(const Vec3& centre, double radius) const override {
    const double most = grown_ + radius;
    if (is_ball_) {
      const double limit = shape_.rounding + most;
      return norm2(centre - pose_.at) <= limit * limit;
    }
    const Vec3 q = pose_.to_local(centre);
    return shape_.bounds.grown(most).meets({q, q});
  }

  bool is_clear_of(const Bounds& box) const override {
    if (!is_ball_) return false;
    const double limit = shape_.rounding + grown_;
    const Vec3 &at = pose_.at, &low = box.low, &high = box.high;
    const Vec3 nearest{std::clamp(at.x, low.x, high.x), std::clamp(at.y, low.y, high.y),
                       std::clamp(at.z, low.z, high.z)};
    return norm2(nearest - at) > limit * limit;
  }

  bool is_outside(const Vec3& p, const Vec3& one, const Vec3& other) const override {
    return dot(one, centre_ - p) > 0.0 || dot(other, centre_ - p) > 0.0;
  }

  double bottom() const override { return bottom_; }
  double depth() const override { return depth_; }

 private:
  const Convex& shape_;
  const Pose& pose_;
  Vec3 centre_;
  double grown_, bottom_, depth_;
  bool is_ball_;
};

Bounds bounds_of(const Convex& shape, const Pose& pose) {
  if (shape.core.vertices.size() == 1) return Bounds{pose.at, pose.at}.grown(shape.rounding);
  const auto [low, high] = pose.rotation * shape.bounds;
  return {low + pose.at, high + pose.at};
}

// Returns true if an edge faces the ground: edges touch by normals that lie between those of the faces of both.
bool faces_ground(const Convex& shape, const Pose& pose, const PolyEdge& edge, const Patch& patch, double angle) {
  const double slack = SEAT + angle;
  if (edge.faces[0] < 0 || patch.steepest < slack) return true;
  const double up = std::min(dot(pose.rotation.row[2], shape.core.faces[edge.faces[0]].normal),
                             dot(pose.rotation.row[2], shape.core.faces[edge.faces[1]].normal));
  return up <= (slack - patch.steepest) * edge.half_cosine;
}

// Appends the contacts of a shape at `pose` whose distance is below its motion in the step and the margin; `grown`: the
// most that this is.
void find_contacts(const Convex& shape, const Pose& pose, const Patch& patch, const Approach& approach, double grown,
                   std::vector<Contact>& contacts) {
  if (shape.kind == ShapeKind::Cylinder) {
    touch_cylinder(shape, pose, patch, approach, contacts);
    return;
  }
  const Polytope& core = shape.core;
  // Most features of a hull of many vertices lie above all ground in reach.
  const double limit = patch.highest + shape.rounding + grown;
  const auto is_low = [&](std::size_t k) { return dot(pose.rotation.row[2], core.vertices[k]) + pose.at.z <= limit; };
  for (std::size_t k = 0; k < core.vertices.size(); ++k)
    if (is_low(k)) touch_vertex(shape, pose, static_cast<int>(k), patch, approach, contacts);
  if (core.edges.empty()) return;  // a ball
  for (const Peak& peak : patch.peaks) touch_peak(shape, pose, peak, patch, approach, contacts);
  const double angle = approach.angle_after_impact(unit(-approach.linear));
  for (std::size_t k = 0; k < core.edges.size(); ++k)
    if ((is_low(core.edges[k].end[0]) || is_low(core.edges[k].end[1])) &&
        faces_ground(shape, pose, core.edges[k], patch, angle))
      touch_edge(shape, pose, static_cast<int>(k), patch, approach, contacts);
}

}  // namespace

void ContactSearch::run(const Convex& shape, const Pose& pose, Tiles& tiles, double time, Approach approach,
                        std::vector<Contact>& contacts, double thickness, const SoilBelow& soil) {
  contacts.clear();
  if (shape.core.vertices.size() != 1)  // no ball
    approach.impact = IMPACT, approach.angle = norm(approach.angular) * approach.duration,
    approach.size = shape.bounding_radius;
  approach.farthest =
      norm(approach.linear) * approach.duration + norm(pose.at - approach.centre) + shape.bounding_radius;
  const double grown = approach.contact_distance(pose.at, shape.bounding_radius);
  const Bounds bounds = bounds_of(shape, pose).grown(grown);
  if (!std::isfinite(norm2(bounds.low) + norm2(bounds.high))) return;
  const ShapeReach reach(shape, pose, grown, bounds.low.z, thickness);
  tiles.gather(bounds, time, approach.ahead, reach, maps, soil);
  tiles.gather_meshes(bounds, time, approach.ahead, reach, meshes);
  for (Patch* patch : {&maps, &meshes}) {
    if (patch->facets.empty()) continue;
    patch->finish();
    const std::size_t first = contacts.size();
    find_contacts(shape, pose, *patch, approach, grown, contacts);
    for (std::size_t k = first; k < contacts.size(); ++k) {
      contacts[k].ground.velocity = patch->velocity_at(contacts[k].point);
      contacts[k].on_mesh = patch == &meshes;
    }
  }
}

void ContactSearch::find_rotations(std::vector<Contact>& contacts) const {
  for (Contact& contact : contacts)
    if (contact.deck < 0) contact.ground.angular = (contact.on_mesh ? meshes : maps).angular_velocity_at(contact.point);
}

}  // namespace smartmesh
