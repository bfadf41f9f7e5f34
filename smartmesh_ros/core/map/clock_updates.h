// Update times of a block of samples: what an update does to them, and how velocities follow from it.
#pragma once

#include "map/motion.h"

namespace smartmesh {

// How the newest velocities follow from an update. Unchanged: they stay. Difference: difference quotient of the
// heights. Merged: of the old ones a share stays, and a quotient is added: the last intervals count as one, or the
// heights were corrected. Given: they came with the heights.
enum class Estimate { Unchanged, Difference, Merged, Given };

// Newest velocity = `keep` [-] x old velocity + `inverse` [1/s] x change of height, unless it was given.
struct VelocityUpdate {
  Estimate estimate = Estimate::Unchanged;
  double inverse = 0.0, keep = 1.0;
};

// Times between updates [s]. Updates that follow sooner than `least` are parts of one update; updates further apart
// than `most` give no velocity.
struct Intervals {
  double least, most;
};

// Stores an update at `time` [s]. `given`: it contains velocities. `whole`: it covers the whole block.
VelocityUpdate note_update(Clock& clock, double time, bool given, bool whole, const Intervals& intervals);

}  // namespace smartmesh
