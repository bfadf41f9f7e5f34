#include "motion.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Age of the last map at which extrapolation ends, in map intervals, and limit of the acceleration as a multiple of the
// one before. See terrain/motion.py for the reasons.
constexpr double LATE_AFTER = 1.5;
constexpr double AGREEMENT = 4.0;
constexpr double FOREVER = std::numeric_limits<double>::infinity();

}  // namespace

Phase phase_of(double time, double last, double lifetime, double lag, Mode mode, double delay) {
  double age = time - last;
  const double late_after = LATE_AFTER * (lifetime + delay);
  if (!(lifetime > 0.0)) return {};
  if (mode == Mode::Hold) return {0.0, 0.0, age <= late_after ? 1.0 : 0.0, 0.0, 0.0, FOREVER};
  if (mode == Mode::Interpolate) {
    const double span = lag > 0.0 ? 2.0 * lag : lifetime;  // time between the last two maps
    age -= delay;
    const double rate = age >= 0.0 && age < span ? 1.0 : 0.0;
    return {std::min(std::max(age - span, -span), 0.0), 0.0, rate, 0.0, 0.0, FOREVER};
  }
  if (age <= late_after) {
    age = std::max(age, -lifetime);
    return {age, 0.5 * age * (age + 2.0 * lag), 1.0, age + lag, 1.0, FOREVER};
  }
  const double bend = 0.5 * late_after * (late_after + 2.0 * lag);
  const double share = 1.0 - 0.5 * (age - late_after) / late_after;
  if (share <= 0.0) return {};
  return {late_after * share, bend * share, -0.5, -0.5 * bend / late_after, 0.0, 2.0 * late_after * share};
}

Phase block_phase(const Clock& clock, double time, Mode mode) {
  if (clock.known == 0) return {};
  Phase phase = phase_of(time, clock.time, clock.lifetime, clock.time - clock.middle, mode, clock.delay);
  if (clock.known < KEPT || mode != Mode::Extrapolate) {
    phase.bend = phase.bend_rate = phase.curve = 0.0;
    return phase;
  }
  phase.inverse = 1.0 / (clock.middle - clock.middle_1);
  phase.inverse_1 = 1.0 / (clock.middle_1 - clock.middle_2);
  return phase;
}

double agreed(double change, double before) {
  if (change * before <= 0.0) return 0.0;
  const double most = AGREEMENT * std::abs(before);
  return std::abs(change) <= most ? change : std::copysign(most, change);
}

Motion motion_of(double velocity, double velocity_1, double velocity_2, const Phase& phase, double max_velocity) {
  if (!(std::abs(velocity) <= max_velocity)) return {};
  if (phase.inverse == 0.0 || !(std::abs(velocity_1) <= max_velocity && std::abs(velocity_2) <= max_velocity))
    return {velocity, 0.0};
  return {velocity,
          agreed((velocity - velocity_1) * phase.inverse, (velocity_1 - velocity_2) * phase.inverse_1)};
}

double rise_of(const Motion& motion, const Phase& phase, double duration) {
  const double lasts = std::min(duration, phase.left);
  return motion.velocity * phase.rate * lasts +
         motion.acceleration * lasts * (phase.bend_rate + 0.5 * phase.curve * lasts);
}

}  // namespace smartmesh
