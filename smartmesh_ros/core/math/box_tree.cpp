#include "math/box_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace smartmesh {

namespace {

// Boxes in a leaf. Raising it makes the tree smaller and looks at more boxes one by one.
constexpr int LEAF = 4;

double along(const Vec3& p, int axis) { return axis == 0 ? p.x : axis == 1 ? p.y : p.z; }

int widest_axis(const Bounds& box) {
  const Vec3 size = box.high - box.low;
  if (size.x >= size.y && size.x >= size.z) return 0;
  return size.y >= size.z ? 1 : 2;
}

// Returns the distance at which a ray enters a box grown by a length; infinity if it does not within `range`.
// `inverse`: of the ray's direction, infinite along an axis that it does not move along.
double entry(const Bounds& box, const Vec3& from, const Vec3& inverse, double range, double grown) {
  double begin = 0.0, end = range;
  const auto clip = [&](double low, double high, double inverse_rate) {
    const double first = low * inverse_rate, second = high * inverse_rate;
    begin = std::max(begin, std::min(first, second));  // NaN, on a side, leaves the other argument
    end = std::min(end, std::max(first, second));
  };
  clip(box.low.x - grown - from.x, box.high.x + grown - from.x, inverse.x);
  clip(box.low.y - grown - from.y, box.high.y + grown - from.y, inverse.y);
  clip(box.low.z - grown - from.z, box.high.z + grown - from.z, inverse.z);
  return begin <= end ? begin : std::numeric_limits<double>::infinity();
}

}  // namespace

void BoxTree::build(const std::vector<Bounds>& boxes) {
  nodes_.clear();
  order_.resize(boxes.size());
  std::iota(order_.begin(), order_.end(), 0);
  std::vector<Vec3> centres;
  for (const Bounds& box : boxes) centres.push_back((box.low + box.high) * 0.5);
  if (!boxes.empty()) add(0, static_cast<int>(boxes.size()), centres);
  refit(boxes);
}

int BoxTree::add(int first, int count, const std::vector<Vec3>& centres) {
  const int node = static_cast<int>(nodes_.size());
  nodes_.push_back({{}, first, count});
  if (count <= LEAF) return node;
  Bounds spread;
  for (int k = first; k < first + count; ++k) spread.add(centres[order_[k]]);
  const int axis = widest_axis(spread), half = count / 2;
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + half, begin + count, [&](int a, int b) {
    const double ca = along(centres[a], axis), cb = along(centres[b], axis);
    return ca < cb || (ca == cb && a < b);
  });
  add(first, half, centres);
  const int second = add(first + half, count - half, centres);
  nodes_[node].first = second, nodes_[node].count = 0;
  return node;
}

void BoxTree::refit(const std::vector<Bounds>& boxes) {
  boxes_.resize(boxes.size());
  for (std::size_t k = 0; k < boxes.size(); ++k) boxes_[k] = boxes[order_[k]];
  for (std::size_t k = nodes_.size(); k-- > 0;) {  // children come after their parents
    Node& node = nodes_[k];
    node.box = {};
    const auto include = [&](const Bounds& box) { node.box.add(box.low), node.box.add(box.high); };
    for (int j = node.first; j < node.first + node.count; ++j) include(boxes_[j]);
    if (node.count == 0) include(nodes_[k + 1].box), include(nodes_[node.first].box);
  }
}

void BoxTree::find(const Bounds& bounds, std::vector<int>& found) const {
  found.clear();
  if (nodes_.empty()) return;
  int open[64], count = 0;  // halving ends long before
  open[count++] = 0;
  while (count > 0) {
    const int k = open[--count];
    const Node& node = nodes_[k];
    if (!node.box.meets(bounds)) continue;
    for (int j = node.first; j < node.first + node.count; ++j)
      if (boxes_[j].meets(bounds)) found.push_back(order_[j]);
    if (node.count == 0) open[count++] = node.first, open[count++] = k + 1;
  }
}

BoxHit BoxTree::first_along(const Vec3& from, const Vec3& way, double range, double grown,
                            const RayTarget& target) const {
  BoxHit best{std::numeric_limits<double>::infinity(), -1};
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
  push(0, entry(nodes_[0].box, from, inverse, limit, grown));
  while (count > 0) {
    const Open next = open[--count];
    if (next.entered > limit) continue;
    const Node& node = nodes_[next.node];
    for (int j = node.first; j < node.first + node.count; ++j) {
      if (!(entry(boxes_[j], from, inverse, limit, grown) <= limit)) continue;
      const double distance = target.distance(order_[j]);
      if (distance <= limit && distance < best.distance) best = {distance, order_[j]}, limit = distance;
    }
    if (node.count > 0) continue;
    const int near = next.node + 1, far = node.first;
    const double to_near = entry(nodes_[near].box, from, inverse, limit, grown);
    const double to_far = entry(nodes_[far].box, from, inverse, limit, grown);
    if (to_near <= to_far)
      push(far, to_far), push(near, to_near);
    else
      push(near, to_near), push(far, to_far);
  }
  return best;
}

}  // namespace smartmesh
