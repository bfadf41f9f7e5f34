// Axis-aligned boxes of bodies, and the islands of bodies that may touch.
//
// Tables have a row for each slot of a body: states, boxes [m], and bounding radii [m].
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "solid.h"

namespace smartmesh {

constexpr int BOX_COLUMNS = 6;
static_assert(sizeof(Bounds) == BOX_COLUMNS * sizeof(double), "the columns of a table of boxes");

// Returns the box of a shape on a body; the smallest one for all but hulls and compounds.
Bounds box_of(const Shape& shape, const BodyPose& body);

// Boxes and radii of bodies. Two bodies may touch if their boxes are closer than `near` [m] plus a `share` of both radii.
struct BodyBoxes {
  const Bounds* boxes;
  const double* radii;
  double near, share;

  // Sorts slots, or places of slots in a list, by the lowest x of the box of each `slot_of`; unknown boxes come last.
  template <class SlotOf>
  void sort(std::vector<std::int64_t>& items, SlotOf slot_of) const {
    const auto low_x = [&](std::int64_t item) {
      const double x = boxes[slot_of(item)].low.x;
      return std::isnan(x) ? std::numeric_limits<double>::infinity() : x;
    };
    std::stable_sort(items.begin(), items.end(), [&](std::int64_t a, std::int64_t b) { return low_x(a) < low_x(b); });
  }
};

// Returns the island of each of the bodies in some `slots`, by the place of its first member in `slots`. Two bodies are in
// one island if they have the same of the `owners` (S,), or may touch, or through others.
std::vector<std::int64_t> islands(const std::vector<std::int64_t>& slots, const std::int64_t* owners,
                                  const BodyBoxes& bodies);

}  // namespace smartmesh
