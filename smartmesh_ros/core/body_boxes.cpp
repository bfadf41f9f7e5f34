#include "body_boxes.h"

#include <numeric>

namespace smartmesh {

namespace {

// Returns the root of an item in a forest, and shortens the way to it.
std::int64_t root_of(std::vector<std::int64_t>& parents, std::int64_t k) {
  while (parents[k] != k) k = parents[k] = parents[parents[k]];
  return k;
}

// Joins the trees of two items. The lower root stays a root, so that it is the first item of its tree.
void join(std::vector<std::int64_t>& parents, std::int64_t a, std::int64_t b) {
  const std::int64_t one = root_of(parents, a), other = root_of(parents, b);
  parents[std::max(one, other)] = std::min(one, other);
}

}  // namespace

Bounds box_of(const Shape& shape, const BodyPose& body) {
  const Solid solid(shape, body);
  const auto along = [&](const Vec3& axis) { return shape.extent(solid.axes * axis); };
  const Vec3 half{along({1.0, 0.0, 0.0}), along({0.0, 1.0, 0.0}), along({0.0, 0.0, 1.0})};
  return {solid.centre - half, solid.centre + half};
}

std::vector<std::int64_t> islands(const std::vector<std::int64_t>& slots, const std::int64_t* owners,
                                  const BodyBoxes& bodies) {
  const std::size_t count = slots.size();
  std::vector<std::int64_t> parents(count), order(count);
  std::iota(parents.begin(), parents.end(), 0), std::iota(order.begin(), order.end(), 0);
  const auto owner = [&](std::int64_t k) { return owners[slots[k]]; };
  std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) { return owner(a) < owner(b); });
  for (std::size_t m = 1; m < count; ++m)
    if (owner(order[m - 1]) == owner(order[m])) join(parents, order[m - 1], order[m]);

  bodies.sort(order, [&](std::int64_t k) { return slots[k]; });
  double largest = 0.0;
  for (std::int64_t slot : slots) largest = std::max(largest, bodies.radii[slot]);
  for (std::size_t m = 0; m < count; ++m) {
    const std::int64_t a = slots[order[m]];
    const double beyond = bodies.boxes[a].high.x + bodies.near + bodies.share * (bodies.radii[a] + largest);
    for (std::size_t n = m + 1; n < count; ++n) {
      const std::int64_t b = slots[order[n]];
      if (bodies.boxes[b].low.x > beyond) break;
      if (bodies.boxes[a].apart_from(bodies.boxes[b]) <= bodies.near + bodies.share * (bodies.radii[a] + bodies.radii[b]))
        join(parents, order[m], order[n]);
    }
  }
  for (std::size_t k = 0; k < count; ++k) parents[k] = root_of(parents, static_cast<std::int64_t>(k));
  return parents;
}

}  // namespace smartmesh
