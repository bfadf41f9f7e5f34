#include "noisy_motion.h"

#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Half width of the window [samples], and the multiple of the noise variance below which scatter counts as noise. See
// terrain/noisy_motion.py for the reasons.
constexpr int HALF_WINDOW = 2;
constexpr double SCATTER_MARGIN = 2.0;

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

double acceleration_variance(double later, double earlier, double noise) {
  if (!(later > 0.0 && earlier > 0.0)) return std::numeric_limits<double>::infinity();
  const double a = noise / later, b = noise / earlier, c = 2.0 / (later + earlier);
  return (a * a + b * b + (a + b) * (a + b)) * (c * c);
}

NoiseVariances noise_variances(const Clock& clock, double noise) {
  const double first = 2.0 * (clock.time - clock.middle);
  const double second = 2.0 * (clock.middle - clock.middle_1) - first;
  const double third = 2.0 * (clock.middle_1 - clock.middle_2) - second;
  if (!(first > 0.0)) return {0.0, 0.0, 0.0};
  const double speed = noise / first;
  return {2.0 * (speed * speed), acceleration_variance(first, second, noise),
          acceleration_variance(second, third, noise)};
}

double signal_share(double power, double noise) { return power > noise ? 1.0 - noise / power : 0.0; }

double denoised(double value, const Spread& around, double variance) {
  if (variance == 0.0) return value;
  const int count = around.pairs;
  const double beyond = 2.0 * around.total / (2 * count + 1), mean = value + beyond;
  // The mean of a pair has half the noise of a value.
  const double scatter = count > 1 ? 2.0 * (around.squares - around.total * around.total / count) / (count - 1) : 0.0;
  const double together = signal_share(mean * mean, variance / (2 * count + 1));
  return together * mean - signal_share(scatter, SCATTER_MARGIN * variance) * beyond;
}

double kept(const HeightGrid& grid, int row, int column, std::int64_t slot) {
  const std::size_t size = static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.columns);
  return static_cast<double>(grid.velocities[static_cast<std::size_t>(slot) * size + grid.index(row, column)]);
}

Velocities velocities_at(const HeightGrid& grid, int row, int column, std::int64_t newest) {
  if (newest < 0 || newest >= KEPT) return {0.0, 0.0, 0.0};  // no clock of a map says so
  const double v0 = kept(grid, row, column, newest);
  const double v1 = kept(grid, row, column, (newest + KEPT - 1) % KEPT);
  const double v2 = kept(grid, row, column, (newest + KEPT - 2) % KEPT);
  return {v0, v1, v2};
}

Velocities without_jumps(const Velocities& v, double most) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  return {std::abs(v.v0) <= most ? v.v0 : nan, std::abs(v.v1) <= most ? v.v1 : nan, std::abs(v.v2) <= most ? v.v2 : nan};
}

bool updated_together(const HeightGrid& grid, const Clock& clock, int row, int column) {
  if (!grid.has(row, column)) return false;
  const Clock& other = grid.clock(row, column);
  return other.time == clock.time && other.middle == clock.middle && other.newest == clock.newest;
}

Motion motion_in_noise(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase) {
  const NoiseVariances variances = noise_variances(clock, grid.noise);
  const auto read = [&](int r, int c) {
    return without_jumps(velocities_at(grid, r, c, clock.newest), grid.max_velocity);
  };
  const Velocities v = read(row, column);
  if (std::isnan(v.v0)) return {};
  const double change = (v.v0 - v.v1) * phase.inverse, change_1 = (v.v1 - v.v2) * phase.inverse_1;
  const bool bends = phase.inverse != 0.0 && !std::isnan(change + change_1);
  Spread speeds, changes, changes_1;
  for (int a = 0; a <= HALF_WINDOW; ++a) {
    for (int b = a > 0 ? -HALF_WINDOW : 1; b <= HALF_WINDOW; ++b) {
      if (!(updated_together(grid, clock, row + a, column + b) && updated_together(grid, clock, row - a, column - b)))
        continue;
      const Velocities p = read(row + a, column + b), q = read(row - a, column - b);
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

}  // namespace

Motion motion_at(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase) {
  if (grid.noise > 0.0) return motion_in_noise(grid, row, column, clock, phase);
  const Velocities v = velocities_at(grid, row, column, clock.newest);
  return motion_of(v.v0, v.v1, v.v2, phase, grid.max_velocity);
}

}  // namespace smartmesh
