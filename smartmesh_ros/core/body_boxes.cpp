#include "body_boxes.h"

#include <algorithm>
#include <cmath>
#include <limits>
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

void write_box(const Shape& shape, const double* body, double* box) {
  const Turn turn{body[3], body[4], body[5], body[6]};
  const Solid solid(shape, {body[0], body[1], body[2]}, turn);
  const auto along = [&](const Vec3& axis) { return shape.extent(solid.axes * axis); };
  const Vec3 half{along({1.0, 0.0, 0.0}), along({0.0, 1.0, 0.0}), along({0.0, 0.0, 1.0})};
  const Vec3 low = solid.centre - half, high = solid.centre + half;
  box[0] = low.x, box[1] = low.y, box[2] = low.z;
  box[3] = high.x, box[4] = high.y, box[5] = high.z;
}

double apart(const double* a, const double* b) {
  double most = -std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) most = std::max({most, a[axis] - b[axis + 3], b[axis] - a[axis + 3]});
  return most;
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

  const auto low_x = [&](std::int64_t k) {  // unknown boxes come last
    const double x = bodies.box(slots[k])[0];
    return std::isnan(x) ? std::numeric_limits<double>::infinity() : x;
  };
  std::stable_sort(order.begin(), order.end(), [&](std::int64_t a, std::int64_t b) { return low_x(a) < low_x(b); });
  double largest = 0.0;
  for (std::int64_t slot : slots) largest = std::max(largest, bodies.radii[slot]);
  for (std::size_t m = 0; m < count; ++m) {
    const std::int64_t a = slots[order[m]];
    const double beyond = bodies.box(a)[3] + bodies.near + bodies.share * (bodies.radii[a] + largest);
    for (std::size_t n = m + 1; n < count; ++n) {
      const std::int64_t b = slots[order[n]];
      if (bodies.box(b)[0] > beyond) break;
      if (apart(bodies.box(a), bodies.box(b)) <= bodies.near + bodies.share * (bodies.radii[a] + bodies.radii[b]))
        join(parents, order[m], order[n]);
    }
  }
  for (std::size_t k = 0; k < count; ++k) parents[k] = root_of(parents, static_cast<std::int64_t>(k));
  return parents;
}

}  // namespace smartmesh
