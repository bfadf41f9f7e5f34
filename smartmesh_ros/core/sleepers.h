// Search for the sleeping bodies that others may touch.
#pragma once

#include <vector>

#include "body_boxes.h"

namespace smartmesh {

// The pose that a still body stays near, and the time since when [s].
struct Anchor {
  BodyPose pose;
  double time;
};
constexpr int ANCHOR_COLUMNS = 8;
static_assert(sizeof(Anchor) == ANCHOR_COLUMNS * sizeof(double), "the columns of a table of anchors");

// Bodies that are awake, by their `slots`. Tables by slot: `states` at the last update, `positions` now and `moved` in the
// coming step [m], and `anchors`.
struct Movers {
  std::vector<std::int64_t> slots;
  const BodyState* states;
  const Vec3 *positions, *moved;
  const Anchor* anchors;
};

// A body is still at a `time` [s] if it has not gone farther than a `distance` [m] for the time `after` [s].
struct Stillness {
  double time, after, distance;
};

// Returns a bound on the distance [m] of any point of a body, with a bounding `radius` [m], from its place at the anchor;
// NaN if there is none.
double strayed(const BodyPose& pose, const BodyPose& anchor, double radius);

// Sleeping bodies, in ascending order of their lowest x. Functions mark bodies by slot in `found`, and return true if any
// are new.
class Sleepers {
 public:
  Sleepers(const BodyBoxes& bodies, std::vector<std::int64_t> slots);

  // Marks the bodies whose boxes are within `reach` [m], plus a share of both radii, of the `box` of a body.
  bool mark_near(const Bounds& box, double reach, double radius, bool* found) const;

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
