// Ground that goes on from what was shown when a map comes, so that neither its height nor its velocity jumps.
//
// Jumps of the height and the velocity act on bodies as impulses. The deviation of what was shown from the motion of
// the new map is stored and decays as a cubic: with `interpolate` until the ground is at that map, one map late; with
// `extrapolate` and `smoothing` over so many map intervals.
#pragma once

#include <vector>

#include "map/map_region.h"

namespace smartmesh {

// Time over which velocities are read [s].
constexpr double READ_OVER = 1e-9;

// Returns the instant from which ground goes on with an update of `time` [s]: up to which it was shown to bodies [s];
// if that is farther than `most` [s] from the update, nobody has stepped on this clock, and the update counts from its
// arrival on.
double instant_of_update(double time, double delay, double shown, double most);

// Sets the time in which the deviations of a block decay, after an update that counts from the instant `since` [s] on.
void set_blend(Clock& clock, double since, const MotionRules& rules);

// The ground of some rows and columns of a map, as it was shown at the instant of an update.
class ShownGround {
 public:
  ShownGround(const HeightGrid& grid, const Span& rows, const Span& columns, double instant);

  // Writes the deviations from the motion after the update. Samples that are or were holes, or jumped, do not blend.
  void write_deviations(HeightGrid& map) const;

 private:
  void read(GridReader& reader, std::ptrdiff_t row, double* heights, double* rises) const;

  Span rows_, columns_;
  double instant_;
  std::vector<double> heights_, rises_;
};

}  // namespace smartmesh
