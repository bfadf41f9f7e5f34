// A binary tree of axis-aligned boxes, for those that meet a given box.
#pragma once

#include <vector>

#include "math/vec3.h"

namespace smartmesh {

// What a ray is checked against in the boxes that it passes through.
struct RayTarget {
  // Returns the distance [m] along the ray to what is in a box, infinity if the ray does not meet it.
  virtual double distance(int place) const = 0;

 protected:
  ~RayTarget() = default;
};

// What a ray meets first: distance [m] and place of the box, -1 = nothing.
struct BoxHit {
  double distance;
  int place;
};

class BoxTree {
 public:
  // Makes the tree anew of `boxes`, which are known by their places.
  void build(const std::vector<Bounds>& boxes);

  // Takes over boxes that have moved. The tree stays right; it is best while neighbours stay neighbours.
  void refit(const std::vector<Bounds>& boxes);

  // Replaces `found` by the places of the boxes that meet `bounds`.
  void find(const Bounds& bounds, std::vector<int>& found) const;

  // Returns what a ray along the unit vector `way` meets first within `range` [m], in boxes grown by a length [m].
  BoxHit first_along(const Vec3& from, const Vec3& way, double range, double grown, const RayTarget& target) const;

 private:
  // A leaf holds the boxes `order_[first]` to `order_[first + count - 1]`. Any other node has no boxes of its own; its
  // children are the node after it and node `first`.
  struct Node {
    Bounds box;
    int first, count;
  };

  int add(int first, int count, const std::vector<Vec3>& centres);

  std::vector<Node> nodes_;
  std::vector<int> order_;
  std::vector<Bounds> boxes_;  // in this order
};

}  // namespace smartmesh
