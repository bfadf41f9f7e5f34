// Motion of a sample of a height map whose heights are noisy: each velocity is shrunk by the share that noise explains.
//
// Without this filter, noise of 1 mm at 60 Hz becomes velocity noise of 8 cm/s, and the ground throws bodies. Noise
// differs between neighbouring samples, while motion hardly does. So the velocity of a sample is split into the mean of
// the samples around it and the deviation from that mean. Each part is multiplied by the share of its power that noise
// of the known variance does not explain, as in Lee's filter (*Digital Image Enhancement and Noise Filtering by Use of
// Local Statistics*, 1980). Unlike there, the mean is shrunk too, so that static ground stays at rest.
#include <cmath>

#include "map/height_grid.h"

namespace smartmesh {

namespace {

// Half width of the window [samples]. The mean over 25 samples has a fifth of the noise; raising it smooths more.
constexpr int HALF_WINDOW = 2;
// Scatter below this multiple of the noise variance counts as noise, because the estimate of the scatter of so few
// values is itself uncertain by two fifths. Raising it suppresses more noise and more small features.
constexpr double SCATTER_MARGIN = 2.0;

// Variances due to noise: of a sample's velocity [m^2/s^2], and of its accelerations [m^2/s^4] from the newest two
// velocities and from the two before.
struct NoiseVariances {
  double velocity, change, change_1;
};

// Sums over pairs of samples on opposite sides of a sample, relative to the value of the sample itself.
struct Spread {
  int pairs = 0;
  double total = 0.0, squares = 0.0;

  void add(double one, double other) {
    const double mean = 0.5 * (one + other);
    ++pairs;
    total += mean;
    squares += mean * mean;
  }
};

struct Velocities {
  double v0, v1, v2;  // newest first [m/s], NaN for jumps
};

// Returns the variance of an acceleration from three heights and the intervals between them [s].
double acceleration_variance(double later, double earlier, double noise) {
  if (!(later > 0.0 && earlier > 0.0)) return INFINITE;
  const double a = noise / later, b = noise / earlier, c = 2.0 / (later + earlier);
  return (a * a + b * b + (a + b) * (a + b)) * (c * c);
}

// Returns the variances for noise of the heights [m]; zero for given velocities.
NoiseVariances noise_variances(const Clock& clock, double noise) {
  const double first = 2.0 * (clock.time - clock.middle);
  const double second = 2.0 * (clock.middle - clock.middle_1) - first;
  const double third = 2.0 * (clock.middle_1 - clock.middle_2) - second;
  if (!(first > 0.0)) return {0.0, 0.0, 0.0};
  const double speed = noise / first;
  return {2.0 * (speed * speed), acceleration_variance(first, second, noise),
          acceleration_variance(second, third, noise)};
}

// Returns the share of a `power` that `noise` does not explain.
double signal_share(double power, double noise) { return power > noise ? 1.0 - noise / power : 0.0; }

// Returns a value shrunk towards zero by the noise of a `variance`, estimated with the values around it.
double denoised(double value, const Spread& around, double variance) {
  if (variance == 0.0) return value;
  const int count = around.pairs;
  const double beyond = 2.0 * around.total / (2 * count + 1), mean = value + beyond;
  // The mean of a pair has half the noise of a value.
  const double scatter = count > 1 ? 2.0 * (around.squares - around.total * around.total / count) / (count - 1) : 0.0;
  const double together = signal_share(mean * mean, variance / (2 * count + 1));
  return together * mean - signal_share(scatter, SCATTER_MARGIN * variance) * beyond;
}

// Reads the velocities of samples that were updated together with those of one block.
class VelocityReader {
 public:
  VelocityReader(const HeightGrid& grid, const Clock& clock)
      : grid_(grid), clock_(clock), last_(grid.velocities, grid.index(grid.rows, 0), clock) {}

  Velocities read(std::size_t i) const {
    return {known(last_.newest[i]), known(last_.second[i]), known(last_.third[i])};
  }
  bool updated_together(int row, int column) const {
    if (!grid_.has(row, column)) return false;
    const Clock& other = grid_.clock(row, column);
    return other.time == clock_.time && other.middle == clock_.middle && other.newest == clock_.newest;
  }

 private:
  double known(double velocity) const { return std::abs(velocity) <= grid_.max_velocity ? velocity : NONE; }

  const HeightGrid& grid_;
  const Clock& clock_;
  LastVelocities<float> last_;
};

// Returns true if the window around a sample lies in its block.
bool within_block(const HeightGrid& grid, int row, int column) {
  constexpr int MASK = (1 << BLOCK_SHIFT) - 1;
  const auto inside = [](int place, int size) {
    return (place & MASK) >= HALF_WINDOW && (place & MASK) <= MASK - HALF_WINDOW && place + HALF_WINDOW < size;
  };
  return inside(row, grid.rows) && inside(column, grid.columns);
}

}  // namespace

// Samples on opposite sides are used as a pair or not at all. Then a velocity that varies linearly across the window
// does not count as noise, and an edge or a hole does not shift the mean.
Motion motion_in_noise(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase) {
  const VelocityReader reader(grid, clock);
  const std::size_t here = grid.index(row, column);
  const Velocities v = reader.read(here);
  if (std::isnan(v.v0)) return {};
  const NoiseVariances variances = noise_variances(clock, grid.noise);
  const double change = (v.v0 - v.v1) * phase.inverse, change_1 = (v.v1 - v.v2) * phase.inverse_1;
  const bool bends = phase.inverse != 0.0 && !std::isnan(change + change_1), whole = within_block(grid, row, column);
  Spread speeds, changes, changes_1;
  for (int a = 0; a <= HALF_WINDOW; ++a) {
    for (int b = a > 0 ? -HALF_WINDOW : 1; b <= HALF_WINDOW; ++b) {
      if (!whole && !(reader.updated_together(row + a, column + b) && reader.updated_together(row - a, column - b)))
        continue;
      const std::ptrdiff_t away = static_cast<std::ptrdiff_t>(a) * grid.columns + b;
      const Velocities p = reader.read(here + away), q = reader.read(here - away);
      if (std::isnan(p.v0 + q.v0)) continue;
      speeds.add(p.v0 - v.v0, q.v0 - v.v0);
      if (bends && !std::isnan(p.v1 + p.v2 + q.v1 + q.v2)) {
        changes.add((p.v0 - p.v1) * phase.inverse - change, (q.v0 - q.v1) * phase.inverse - change);
        changes_1.add((p.v1 - p.v2) * phase.inverse_1 - change_1, (q.v1 - q.v2) * phase.inverse_1 - change_1);
      }
    }
  }
  const double velocity = denoised(v.v0, speeds, variances.velocity);
  if (!bends) return {velocity, 0.0};
  return {velocity,
          agreed(denoised(change, changes, variances.change), denoised(change_1, changes_1, variances.change_1))};
}

}  // namespace smartmesh
