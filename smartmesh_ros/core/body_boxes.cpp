#include "body_boxes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace smartmesh {

namespace {

// Returns half the extents of a shape along the axes of the world.
Vec3 half_extents(const ShapeRecord& shape, const Turn& orientation) {
  const double *half = shape.half, rounding = shape.rounding;
  if (shape.kind == ShapeKind::Ball) return {rounding, rounding, rounding};
  const Mat3 axes = axes_of(orientation * Turn{shape.turn[0], shape.turn[1], shape.turn[2], shape.turn[3]});
  const Vec3 &u = axes.row[0], &v = axes.row[1], &w = axes.row[2];
  const auto along = [&](double a, double b, double c) {
    if (shape.kind == ShapeKind::Cylinder) return half[0] * std::sqrt(a * a + b * b) + half[2] * std::abs(c) + rounding;
    return std::abs(a) * half[0] + std::abs(b) * half[1] + std::abs(c) * half[2] + rounding;
  };
  return {along(u.x, v.x, w.x), along(u.y, v.y, w.y), along(u.z, v.z, w.z)};
}

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

void write_box(const ShapeRecord& shape, const double* body, double* box) {
  const Turn orientation{body[3], body[4], body[5], body[6]};
  const Vec3 offset{shape.offset[0], shape.offset[1], shape.offset[2]};
  const Vec3 centre = Vec3{body[0], body[1], body[2]} + rotated(orientation, offset);
  const Vec3 half = half_extents(shape, orientation), low = centre - half, high = centre + half;
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
