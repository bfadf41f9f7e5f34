// Axis-aligned boxes of bodies, and the islands of bodies that may touch.
//
// Tables have a row for each slot of a body: states (S, 13), boxes (S, 6) with the lowest and highest x, y, z [m], and
// bounding radii (S,) [m].
#pragma once

#include <vector>

#include "solid.h"

namespace smartmesh {

constexpr int BOX_COLUMNS = 6;

// Writes the box (6,) of a shape on a body (13,); the smallest one for all but hulls and compounds.
void write_box(const Shape& shape, const double* body, double* box);

// Returns the largest distance of two boxes (6,) along an axis [m], negative if they overlap.
double apart(const double* a, const double* b);

// Boxes and radii of bodies. Two bodies may touch if their boxes are closer than `near` [m] plus a `share` of both radii.
struct BodyBoxes {
  const double *boxes, *radii;
  double near, share;

  const double* box(std::int64_t slot) const { return boxes + BOX_COLUMNS * slot; }
};

// Returns the island of each of the bodies in some `slots`, by the place of its first member in `slots`. Two bodies are in
// one island if they have the same of the `owners` (S,), or may touch, or through others.
std::vector<std::int64_t> islands(const std::vector<std::int64_t>& slots, const std::int64_t* owners,
                                  const BodyBoxes& bodies);

}  // namespace smartmesh
