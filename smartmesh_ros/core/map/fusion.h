// Fusion of repeated height measurements of static ground: a Kalman filter with one state per sample, see
// terrain/corrections.py.
#pragma once

#include <cstddef>

namespace smartmesh {

// Variance [m^2] that was `grown` since the last measurements, and the square of the gate [standard deviations] beyond
// which a sample restarts from the measurement.
struct FilterStep {
  float grown, gate_squared;
};

// Updates `count` samples: `heights` [m], NaN = not measured yet, and their `variances` [m^2]. `measured` [m]: NaN =
// not seen, which keeps the height. `noises` [m^2]: variances of the measurements; zero replaces the height, and a
// height whose variance is negative or not finite is ignored.
void fuse(float* heights, float* variances, const float* measured, const float* noises, std::size_t count,
          const FilterStep& step);

}  // namespace smartmesh
