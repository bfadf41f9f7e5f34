#include "map/fusion.h"

#include <limits>

namespace smartmesh {

// Without branches, so that the compiler computes several samples at once.
void fuse(float* heights, float* variances, const float* measured, const float* noises, std::size_t count,
          const FilterStep& step) {
  constexpr float INFINITE = std::numeric_limits<float>::infinity();
  const float grown = step.grown, gate_squared = step.gate_squared;
  for (std::size_t c = 0; c < count; ++c) {
    const float known = heights[c], seen = measured[c], noise = noises[c];
    const float prior = variances[c] + grown, innovation = seen - known, spread = prior + noise, gain = prior / spread;
    const bool is_seen = (seen == seen) & (noise >= 0.0f) & (noise < INFINITE);
    // The comparison is false for a sample without a height (NaN), which therefore starts from the measurement.
    const bool agrees = (noise > 0.0f) & (innovation * innovation <= gate_squared * spread);
    const float height = agrees ? known + gain * innovation : seen, variance = agrees ? gain * noise : noise;
    heights[c] = is_seen ? height : known;
    variances[c] = is_seen ? variance : prior;
  }
}

}  // namespace smartmesh
