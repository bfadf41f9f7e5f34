#include "motion.h"

#include <algorithm>
#include <limits>

namespace smartmesh {

namespace {

// Age of the last map at which extrapolation ends, as a multiple of the age at which the next map is expected. Older ground
// returns to the last map at half its speed, because a sudden reset would teleport it. Raising this tolerates later maps,
// but overshoots further.
constexpr double LATE_AFTER = 1.5;
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

}  // namespace smartmesh
