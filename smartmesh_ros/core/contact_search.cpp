#include "contact_search.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Part of the ground that a shape may touch in the step: around its box, grown by the way it may come.
class ShapeReach final : public Reach {
 public:
  ShapeReach(const Convex& shape, const Pose& pose, double grown)
      : shape_(shape), pose_(pose), centre_(pose.to_world(shape.centre)), grown_(grown) {
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

  bool is_clear_of(const Vec3 (&corners)[4]) const override {
    if (!is_ball_) return false;
    const double limit = shape_.rounding + grown_;
    Bounds bounds;
    for (const Vec3& p : corners)
      if (!std::isnan(p.z)) bounds.add(p);
    const Vec3 &at = pose_.at, &low = bounds.low, &high = bounds.high;
    const Vec3 nearest{std::clamp(at.x, low.x, high.x), std::clamp(at.y, low.y, high.y), std::clamp(at.z, low.z, high.z)};
    return norm2(nearest - at) > limit * limit;
  }

  bool is_outside(const Vec3& p, const Vec3& one, const Vec3& other) const override {
    return dot(one, centre_ - p) > 0.0 || dot(other, centre_ - p) > 0.0;
  }

 private:
  const Convex& shape_;
  const Pose& pose_;
  Vec3 centre_;
  double grown_;
  bool is_ball_;
};

Bounds bounds_of(const Convex& shape, const Pose& pose) {
  Bounds bounds;
  for (int k = 0; k < 8; ++k)
    bounds.add(pose.to_world({k & 1 ? shape.bounds.high.x : shape.bounds.low.x,
                              k & 2 ? shape.bounds.high.y : shape.bounds.low.y,
                              k & 4 ? shape.bounds.high.z : shape.bounds.low.z}));
  return bounds;
}

}  // namespace

void ContactSearch::run(const Convex& shape, const Pose& pose, Surface& surface, double time, const Approach& approach,
                        std::vector<Contact>& contacts) {
  contacts.clear();
  const double grown = approach.reach(pose.at, shape.reach);
  const Bounds bounds = bounds_of(shape, pose).grown(grown);
  if (!std::isfinite(norm2(bounds.low) + norm2(bounds.high))) return;
  const ShapeReach reach(shape, pose, grown);
  surface.gather(bounds, time, reach, maps_);
  surface.gather_meshes(bounds, time, reach, meshes_);
  for (Patch* patch : {&maps_, &meshes_}) {
    patch->finish();
    find_contacts(shape, pose, *patch, approach, contacts);
  }
}

}  // namespace smartmesh
