#include "map/motion.h"

#include <algorithm>

namespace smartmesh {

namespace {

// Age of the last map at which extrapolation ends, as a multiple of the age at which the next map is expected. Older
// ground returns to the last map at half its speed, because a sudden reset would teleport it. Raising this tolerates
// later maps, but overshoots further.
constexpr double LATE_AFTER = 1.5;

// Returns the phase at an `age` [s]; from the age `late_after` [s] on the ground returns.
Phase extrapolated(double age, double late_after, double lag) {
  if (age <= late_after) return {age, 0.5 * age * (age + 2.0 * lag), 1.0, age + lag, 1.0, INFINITE};
  const double bend = 0.5 * late_after * (late_after + 2.0 * lag);
  const double share = 1.0 - 0.5 * (age - late_after) / late_after;
  if (share <= 0.0) return {};
  return {late_after * share, bend * share, -0.5, -0.5 * bend / late_after, 0.0, 2.0 * late_after * share};
}

}  // namespace

Phase phase_of(double time, double last, double lifetime, double lag, Mode mode, double delay) {
  const double age = time - last, due = lifetime + delay;
  if (!(lifetime > 0.0)) return {};
  if (mode == Mode::Hold) return {0.0, 0.0, age <= LATE_AFTER * due ? 1.0 : 0.0, 0.0, 0.0, INFINITE};
  if (mode == Mode::Interpolate) return extrapolated(std::max(age - due, -due), (LATE_AFTER - 1.0) * due, lag);
  return extrapolated(std::max(age, -lifetime), LATE_AFTER * due, lag);
}

Phase block_phase(const Clock& clock, double time, Mode mode) {
  if (clock.known == 0) return {};
  const double lag = clock.time - clock.middle;
  Phase phase = mode == Mode::Interpolate && clock.lifetime > 0.0
                    ? extrapolated(std::max(time, clock.since) - clock.until,
                                   (LATE_AFTER - 1.0) * (clock.lifetime + clock.delay), lag)
                    : phase_of(time, clock.time, clock.lifetime, lag, mode, clock.delay);
  if (clock.known < KEPT || mode == Mode::Hold) {
    phase.bend = phase.bend_rate = phase.curve = 0.0;
    return phase;
  }
  phase.inverse = 1.0 / (clock.middle - clock.middle_1);
  phase.inverse_1 = 1.0 / (clock.middle_1 - clock.middle_2);
  if (mode == Mode::Interpolate) {
    phase.lag = lag;
    phase.third = lag * (clock.middle - clock.middle_1) / (lag + (clock.middle_1 - clock.middle_2));
  }
  return phase;
}

bool may_move(const Clock& clock, double time, Mode mode) {
  if (clock.known == 0) return false;
  const double due = clock.lifetime + clock.delay, returns = mode == Mode::Interpolate ? REST_AFTER - LATE_AFTER : 0.0;
  return goes_on(time, clock.time, clock.lifetime, clock.delay) || time < clock.until + returns * due;
}

Blend MotionRules::blend(const Clock& clock, double time, double ahead) const {
  if (!blends() || clock.known == 0) return {};
  const double span = clock.until - clock.since;
  const double now = std::max(time - clock.since, 0.0) / span, then = std::min(now + ahead / span, 1.0);
  if (!(now < 1.0)) return {};
  const double step = then - now, middle = 0.5 * (now + then), left = 1.0 - now;
  return {left * left * (1.0 + 2.0 * now), span * now * left * left,
          step * (6.0 * middle * (middle - 1.0) + 0.5 * step * step),
          span * step * (1.0 + middle * (3.0 * middle - 4.0) + 0.25 * step * step)};
}

}  // namespace smartmesh
