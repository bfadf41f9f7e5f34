// Motion of the ground between maps: second order, from the last three velocities of a sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "math/vec3.h"

namespace smartmesh {

// Number of velocities stored for each sample, and of update intervals stored for each block.
constexpr int KEPT = 3;
constexpr int INTERVALS_KEPT = 10;

// As in terrain/motion.py; Correct is the last.
enum class Mode : int { Hold, Extrapolate, Interpolate, Correct };

// Update times of a block of samples; CLOCK in terrain/motion.py, made from this, explains the fields.
struct Clock {
  double time, opened, lifetime, delay, middle, middle_1, middle_2, since, until;
  std::int64_t known, newest;
  double intervals[INTERVALS_KEPT];
  std::int64_t count, updates;
};

// Age of the last map at which the ground is at rest at the map's heights, as a multiple of the age at which the next
// map is expected: three times LATE_AFTER.
constexpr double REST_AFTER = 4.5;

// Returns true if two blocks move alike: they were updated at the same times.
inline bool same_times(const Clock& a, const Clock& b) {
  return a.time == b.time && a.lifetime == b.lifetime && a.delay == b.delay && a.middle == b.middle &&
         a.middle_1 == b.middle_1 && a.middle_2 == b.middle_2 && a.since == b.since && a.until == b.until &&
         a.known == b.known && a.newest == b.newest;
}

// Returns true if ground whose last map came at `last` [s] may move at `time` [s]; `lifetime` and `delay` as in
// `Clock`.
inline bool goes_on(double time, double last, double lifetime, double delay) {
  return lifetime > 0.0 && time < last + REST_AFTER * (lifetime + delay);
}

// Coefficients of the motion at one instant. Height above the last map: velocity * along + acceleration * bend. Its
// rate: velocity * rate + acceleration * bend_rate. That rate changes by acceleration * curve per second and ends after
// a time `left` [s]. `inverse`, `inverse_1` [1/s]: reciprocals of the times between the velocities, newest first, zero
// = unknown. If `third` [s] is not zero, the velocity at the last map is that of the cubic through the last four
// heights: velocity + change * lag + (change - change before) * third, where changes are those of velocities, per
// second.
struct Phase {
  double along = 0.0, bend = 0.0, rate = 0.0, bend_rate = 0.0, curve = 0.0, left = 0.0, inverse = 0.0, inverse_1 = 0.0;
  double lag = 0.0, third = 0.0;
};

// Weights by which the ground still deviates from the motion of the last map, because it goes on without a jump from
// what was shown when that map came: of the deviation then, of its rate [s], and their changes within a time ahead.
struct Blend {
  double offset = 0.0, rate = 0.0, offset_change = 0.0, rate_change = 0.0;
};

// Velocity [m/s] and acceleration [m/s^2] of a sample at its last map.
struct Motion {
  double velocity = 0.0, acceleration = 0.0;
};

// Returns the phase at `time` [s] of ground whose last map came at `last` [s]. `lifetime` [s]: expected time until the
// next map. `lag` [s]: the velocity holds at this time before the last map. `delay` [s]: expected age of the next map
// on arrival.
Phase phase_of(double time, double last, double lifetime, double lag, Mode mode, double delay);

// Returns the phase of a block at `time` [s].
Phase block_phase(const Clock& clock, double time, Mode mode);

// Returns true if a block may move at `time` [s].
bool may_move(const Clock& clock, double time, Mode mode);

// How ground moves between maps: see MotionConfig in terrain/motion.py. `shown` [s]: instant up to which it was shown
// to bodies, infinity before.
struct MotionRules {
  Mode mode = Mode::Extrapolate;
  double max_velocity = 0.0, smoothing = 0.0;  // [m/s], [map intervals]
  double shown = INFINITE;

  // Returns true if ground goes on from what was shown when a map comes, and does not jump.
  bool blends() const { return mode == Mode::Interpolate || (mode == Mode::Extrapolate && smoothing > 0.0); }
  // Returns the weights at `time` [s], with changes within the time `ahead` [s]: cubics that lead from one to zero
  // between the clock's `since` and `until`, with and without a slope at first. None if ground does not blend.
  Blend blend(const Clock& clock, double time, double ahead) const;
};

// Change of velocity up to the last map below which it counts as smooth, as a share of the velocity. Raising it
// overshoots more where ground stops or jolts.
constexpr double SMOOTH = 0.25;

// Limit of an acceleration, as a multiple of the one before, against overshoot where ground stops, jolts or jumps.
constexpr double AGREEMENT = 4.0;

// Returns a `change` limited to what lies between zero and a multiple of the one `before`.
inline double agreed(double change, double before) {
  const double most = AGREEMENT * before;
  return std::max(std::min(most, 0.0), std::min(std::max(most, 0.0), change));
}

// Returns the motion of a sample from its velocities, newest first [m/s]. A velocity that is NaN (the sample is or was
// a hole) or above `max_velocity` (a jump) counts as no motion.
inline Motion motion_of(double velocity, double velocity_1, double velocity_2, const Phase& phase,
                        double max_velocity) {
  if (!(std::abs(velocity) <= max_velocity)) return {};
  if (phase.inverse == 0.0 || !(std::abs(velocity_1) <= max_velocity && std::abs(velocity_2) <= max_velocity))
    return {velocity, 0.0};
  return {velocity, agreed((velocity - velocity_1) * phase.inverse, (velocity_1 - velocity_2) * phase.inverse_1)};
}

// As `motion_of`, with a velocity at the last map of third order where motion is smooth, for a phase with `third`.
inline Motion third_order_motion_of(double velocity, double velocity_1, double velocity_2, const Phase& phase,
                                    double max_velocity) {
  const Motion second = motion_of(velocity, velocity_1, velocity_2, phase, max_velocity);
  if (!(std::abs(velocity) <= max_velocity && std::abs(velocity_1) <= max_velocity &&
        std::abs(velocity_2) <= max_velocity))
    return second;
  const double change = (velocity - velocity_1) * phase.inverse, change_1 = (velocity_1 - velocity_2) * phase.inverse_1;
  const double limited = second.acceleration;
  const double since_then = change * phase.lag + (change - change_1) * phase.third;
  const bool is_smooth = (change == limited) | (std::abs(since_then) <= SMOOTH * std::abs(velocity));
  return {velocity + (is_smooth ? since_then - limited * phase.lag : 0.0), limited};
}

// The last velocities of samples of one clock, newest first; null: there are none.
template <class Number>
struct LastVelocities {
  const Number *newest = nullptr, *second = nullptr, *third = nullptr;

  LastVelocities() = default;
  // `ring`: buffer (KEPT, size).
  LastVelocities(const Number* ring, std::size_t size, const Clock& clock) {
    if (clock.known == 0 || clock.newest < 0 || clock.newest >= KEPT) return;
    const auto kept = [&](int age) {
      return ring + size * static_cast<std::size_t>((clock.newest + KEPT - age) % KEPT);
    };
    newest = kept(0), second = kept(1), third = kept(2);
  }

  // Returns the motion of a sample of which there are velocities.
  Motion motion(std::size_t i, const Phase& phase, double max_velocity) const {
    return phase.third == 0.0 ? motion_of(newest[i], second[i], third[i], phase, max_velocity)
                              : third_order_motion_of(newest[i], second[i], third[i], phase, max_velocity);
  }
};

inline double displacement(const Motion& motion, const Phase& phase) {
  return motion.velocity * phase.along + motion.acceleration * phase.bend;
}

// Returns the rise of a sample [m] within a `duration` [s].
inline double rise_of(const Motion& motion, const Phase& phase, double duration) {
  const double lasts = std::min(duration, phase.left);
  return motion.velocity * phase.rate * lasts +
         motion.acceleration * lasts * (phase.bend_rate + 0.5 * phase.curve * lasts);
}

}  // namespace smartmesh
