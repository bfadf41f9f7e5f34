// A binary tree of axis-aligned boxes, for those that meet a given box.
#pragma once

#include <vector>

#include "math/vec3.h"

namespace smartmesh {

// What a ray meets first: distance [m] and place of the box, -1 = nothing.
struct BoxHit {
  double distance;
  int place;
};

// Returns the distance at which a ray enters a box grown by a length; infinity if it does not within `range`.
// `inverse`: of the ray's direction, infinite along an axis that it does not move along.
inline double entry_of(const Bounds& box, const Vec3& from, const Vec3& inverse, double range, double grown) {
  double begin = 0.0, end = range;
  const auto clip = [&](double low, double high, double inverse_rate) {
    const double first = low * inverse_rate, second = high * inverse_rate;
    begin = std::max(begin, std::min(first, second));  // NaN, on a side, leaves the other argument
    end = std::min(end, std::max(first, second));
  };
  clip(box.low.x - grown - from.x, box.high.x + grown - from.x, inverse.x);
  clip(box.low.y - grown - from.y, box.high.y + grown - from.y, inverse.y);
  clip(box.low.z - grown - from.z, box.high.z + grown - from.z, inverse.z);
  return begin <= end ? begin : INFINITE;
}

class BoxTree {
 public:
  // Makes the tree anew of `boxes`, which are known by their places.
  void build(const std::vector<Bounds>& boxes);

  // Takes over boxes that have moved. The tree stays right; it is best while neighbours stay neighbours.
  void refit(const std::vector<Bounds>& boxes);

  // Replaces `found` by the places of the boxes that meet `bounds`.
  void find(const Bounds& bounds, std::vector<int>& found) const;

  // Returns what a ray along the unit vector `way` meets first within `range` [m], in boxes grown by a length [m].
  // `distance_to(place)`: distance [m] along the ray to what is in a box, infinity if the ray does not meet it.
  template <class Distance>
  BoxHit first_along(const Vec3& from, const Vec3& way, double range, double grown, const Distance& distance_to) const;

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

template <class Distance>
BoxHit BoxTree::first_along(const Vec3& from, const Vec3& way, double range, double grown,
                            const Distance& distance_to) const {
  BoxHit best{INFINITE, -1};
  if (nodes_.empty()) return best;
  const Vec3 inverse{1.0 / way.x, 1.0 / way.y, 1.0 / way.z};
  struct Open {
    int node;
    double entered;
  } open[64];  // halving ends long before
  int count = 0;
  double limit = range;
  const auto push = [&](int node, double entered) {
    if (entered <= limit) open[count++] = {node, entered};
  };
  push(0, entry_of(nodes_[0].box, from, inverse, limit, grown));
  while (count > 0) {
    const Open next = open[--count];
    if (next.entered > limit) continue;
    const Node& node = nodes_[next.node];
    for (int j = node.first; j < node.first + node.count; ++j) {
      if (!(entry_of(boxes_[j], from, inverse, limit, grown) <= limit)) continue;
      const double distance = distance_to(order_[j]);
      if (distance <= limit && distance < best.distance) best = {distance, order_[j]}, limit = distance;
    }
    if (node.count > 0) continue;
    const int near = next.node + 1, far = node.first;
    const double to_near = entry_of(nodes_[near].box, from, inverse, limit, grown);
    const double to_far = entry_of(nodes_[far].box, from, inverse, limit, grown);
    if (to_near <= to_far)
      push(far, to_far), push(near, to_near);
    else
      push(near, to_near), push(far, to_far);
  }
  return best;
}

}  // namespace smartmesh
