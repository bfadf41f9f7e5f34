// The place at which the soil under a body has the force and the moments of the body's contacts.
#pragma once

#include <vector>

#include "soil_law.h"

namespace smartmesh {

// Pressure of the soil on a sample [Pa]; `total`, with damping, zero where the body lifts off; derivative of the total
// by the sinkage [Pa/m].
struct SampleLoad {
  double pressure, total, stiffness;
};

// A sample under a body. Heights [m] without the grid's z: of the body's underside `low`, of the ground `now` and as it
// was never pressed, `level`. `area` [m^2]: covered by the body; zero on the rim around it. `x`, `y`: distance from the
// body's middle along columns and rows, in sizes of the body.
struct UnderSample {
  int row, column;
  const PatchSoil* soil;
  double low, now, level, area, x, y;
  Yield before;
  SampleLoad load;  // at the lean that was tried last; unknown on the rim
  double slid;      // shear displacement of the soil [m]
};

// How far a body goes down [m], and how much farther at its size along columns and rows [m].
struct Lean {
  double down, x, y;
};

// Returns the height to which a sample is pressed [m].
inline double pressed_to(const UnderSample& sample, const Lean& lean) {
  return sample.low - lean.down - lean.x * sample.x - lean.y * sample.y;
}

inline SampleLoad load_at(const UnderSample& sample, const Lean& lean, double dt) {
  const PatchSoil& soil = *sample.soil;
  const double height = pressed_to(sample, lean), sinkage = sample.level - height;
  if (sinkage <= 0.0) return {0.0, 0.0, 0.0};
  const double pressure = pressure_at(sinkage, sample.before, soil);
  const double total = pressure + soil.damping * (sample.now - height) / dt;
  if (total <= 0.0) return {0.0, 0.0, 0.0};
  return {pressure, total, stiffness_at(sinkage, pressure, sample.before, soil) + soil.drag};
}

// Returns how far the body goes down [m], at most `deepest`, so that the soil carries a `load` [N]. Newton's method
// from `lean`, whose other parts stay, with bisection where it leaves the bracket: the force grows with the depth. The
// samples keep their loads there.
double balance(std::vector<UnderSample>& samples, double load, const Lean& lean, double deepest, double dt);

// What the contacts have [N]: the load, and its moments relative to the body's size. Limits [m]: the body goes down by
// at most `deepest`, and leans by at most `most`, because contacts at its edge may need more than the soil there can
// give.
struct Wanted {
  double load, moment_x, moment_y;
  double deepest, most;
};

// Changes `lean` until the soil has what is wanted, by Newton's method with halved steps; false if that was not
// reached. If it was, the samples keep their loads there.
bool lean_over(std::vector<UnderSample>& samples, const Wanted& wanted, double dt, Lean& lean);

}  // namespace smartmesh
