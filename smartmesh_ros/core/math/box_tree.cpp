#include "math/box_tree.h"

#include <algorithm>
#include <numeric>

namespace smartmesh {

namespace {

// Boxes in a leaf. Raising it makes the tree smaller and looks at more boxes one by one.
constexpr int LEAF = 4;

int widest_axis(const Bounds& box) {
  const Vec3 size = box.high - box.low;
  if (size.x >= size.y && size.x >= size.z) return 0;
  return size.y >= size.z ? 1 : 2;
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
    const double ca = component(centres[a], axis), cb = component(centres[b], axis);
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

}  // namespace smartmesh
