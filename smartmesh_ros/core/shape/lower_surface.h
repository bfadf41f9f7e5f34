// The lower surface of a body, seen along vertical lines.
#pragma once

#include <vector>

#include "shape/body_shape.h"
#include "shape/convex.h"

namespace smartmesh {

// Returns a part in its own frame, with its features.
Convex convex_of(const ShapePart& part);

// The convex parts of a body or of several links.
class LowerSurface {
 public:
  // `shapes`: of the links, each about its centre of mass.
  explicit LowerSurface(const std::vector<BodyShape>& shapes);
  std::size_t size() const { return links_; }
  // Returns a box around all parts with their links at some poses.
  Bounds bounds(const BodyPose* poses) const;
  // Returns the heights of the lower surface at points (x, y) [m], NaN where a vertical line misses all parts.
  std::vector<double> find(const BodyPose* poses, const double* points, std::size_t count) const;
  // Adds the lowest point of each part along a unit vector of the world.
  void add_lowest(const BodyPose* poses, const Vec3& up, std::vector<Vec3>& points) const;

 private:
  struct Part {
    Convex shape;
    Shape placed;  // in the frame of its link
    std::size_t link;
  };
  std::size_t links_;
  std::vector<Part> parts_;
};

}  // namespace smartmesh
