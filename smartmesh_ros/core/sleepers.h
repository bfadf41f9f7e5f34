// Search for the sleeping bodies that others may touch.
#pragma once

#include <vector>

#include "body_boxes.h"

namespace smartmesh {

// Bodies that are awake, by their `slots`. Tables by slot: `states` (S, 13) at the last update, `positions` now and
// `moved` in the coming step (S, 3) [m], and `anchors` (S, 8): the pose that a still body stays near, and the time since
// when [s].
struct Movers {
  std::vector<std::int64_t> slots;
  const double *states, *positions, *moved, *anchors;
};

constexpr int ANCHOR_COLUMNS = 8;

// A body is still at a `time` [s] if it has not gone farther than a `distance` [m] for the time `after` [s].
struct Stillness {
  double time, after, distance;
};

// Returns a bound on the distance [m] of any point of a body, with a bounding `radius` [m], from its place at the anchor;
// NaN if there is none.
double strayed(const double* state, const double* anchor, double radius);

// Sets the anchor of a body to its state at `time` [s], if it has gone farther than a `distance` [m] from it.
void move_anchor(const double* state, double radius, double time, double distance, double* anchor);

// Sleeping bodies, in ascending order of their lowest x. Functions mark bodies by slot in `found`, and return true if any
// are new.
class Sleepers {
 public:
  Sleepers(const BodyBoxes& bodies, std::vector<std::int64_t> slots);

  // Marks the bodies whose boxes are within `reach` [m], plus a share of both radii, of the `box` of a body.
  bool mark_near(const double* box, double reach, double radius, bool* found) const;

  // Marks all bodies that are connected to marked ones.
  void mark_connected(bool* found) const;

  // Marks the bodies that others may touch in the coming step, `elapsed` [s] after their last update. Bodies that are
  // still do not count.
  bool mark_reached(const Movers& movers, const Stillness& stillness, double elapsed, bool* found) const;

  const BodyBoxes& bodies() const { return bodies_; }

 private:
  BodyBoxes bodies_;
  std::vector<std::int64_t> order_;
  double widest_ = 0.0;  // largest extent of their boxes along x, plus the share of their largest radius [m]
};

}  // namespace smartmesh
