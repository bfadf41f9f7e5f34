#include "ground/frame_motion.h"

#include <algorithm>
#include <cmath>

#include "map/height_grid.h"

namespace smartmesh {

namespace {

// Age of the last sample up to which a frame moves on, in longest intervals between samples, and the further time in
// which it stops.
constexpr double LATE_AFTER = 1.5, STOPS_IN = 3.0;
// Longer intervals before the last one were pauses [s], as `max_interval` says of maps.
constexpr double LONGEST_INTERVAL = 0.25;
// Interval up to which samples are of one instant [s]: numbers of seconds since 1970 are rounded to 2.4e-7 s.
constexpr double ROUNDING = 1e-6;

// Returns the rotation by a vector: about its direction, by its length [rad].
Quaternion quaternion_of(const Vec3& v) {
  const double angle = norm(v);
  const double share = angle > 1e-9 ? std::sin(0.5 * angle) / angle : 0.5;
  return {v.x * share, v.y * share, v.z * share, std::cos(0.5 * angle)};
}

// Returns the vector of the rotation that leads from one orientation to another the short way [rad].
Vec3 rotation_vector(const Quaternion& from, const Quaternion& to) {
  const Quaternion d = to * from.inverse();
  const Vec3 v = Vec3{d.x, d.y, d.z} * (d.w < 0.0 ? -1.0 : 1.0);
  const double sine = norm(v);
  return sine > 1e-12 ? v * (2.0 * std::atan2(sine, std::abs(d.w)) / sine) : v * 2.0;
}

Quaternion normalised(const Quaternion& q) {
  const double scale = 1.0 / std::sqrt(dot(q, q));
  return {q.x * scale, q.y * scale, q.z * scale, q.w * scale};
}

// Returns the mean velocity between two samples.
FrameVelocity between(const FrameSample& before, const FrameSample& after) {
  const double rate = 1.0 / (after.time - before.time);
  return {(after.at - before.at) * rate, rotation_vector(before.orientation, after.orientation) * rate};
}

// Returns the difference of two velocities, times a `rate` [1/s].
FrameVelocity difference(const FrameVelocity& a, const FrameVelocity& b, double rate) {
  return {(a.linear - b.linear) * rate, (a.angular - b.angular) * rate};
}

Vec3 agreed_by_axis(const Vec3& change, const Vec3& before) {
  return {agreed(change.x, before.x), agreed(change.y, before.y), agreed(change.z, before.z)};
}

FrameVelocity agreed(const FrameVelocity& change, const FrameVelocity& before) {
  return {agreed_by_axis(change.linear, before.linear), agreed_by_axis(change.angular, before.angular)};
}

}  // namespace

void FrameMotion::put(const FrameSample& sample) {
  FrameSample& now = samples[0];
  now = sample, now.orientation = normalised(sample.orientation);
  known = 1.0, lasts = INFINITE;
  velocity = sample.velocity, change = {};
  revision_ = next_revision();
}

void FrameMotion::note(const FrameSample& sample) {
  if (known == 0.0 || sample.time < time()) return put(sample);
  if (rests_at(sample)) return;
  if (sample.time - time() > ROUNDING) {
    std::copy_backward(samples, samples + INTERVALS_KEPT, samples + INTERVALS_KEPT + 1);
    known = std::min(known + 1.0, INTERVALS_KEPT + 1.0);
  }
  samples[0] = sample, samples[0].orientation = normalised(sample.orientation);
  if (known > 1.0)
    estimate();
  else
    put(sample);
  revision_ = next_revision();
}

// Differences of velocities that are told hold between two samples; those of mean velocities, which hold in the middle
// of their intervals, between three.
FrameVelocity FrameMotion::change_before(int age) const {
  const FrameSample &now = samples[age], &before = samples[age + 1];
  if (now.is_told != 0.0) return difference(now.velocity, before.velocity, 1.0 / (now.time - before.time));
  const FrameSample& first = samples[age + 2];
  return difference(between(before, now), between(first, before), 2.0 / (now.time - first.time));
}

void FrameMotion::estimate() {
  const FrameSample &now = samples[0], &before = samples[1];
  const double interval = now.time - before.time;
  const FrameVelocity last = between(before, now);
  double longest = interval;
  for (int k = 1; k + 1 < known; ++k)
    if (const double earlier = samples[k].time - samples[k + 1].time; earlier <= LONGEST_INTERVAL)
      longest = std::max(longest, earlier);
  lasts = LATE_AFTER * longest, change = {};
  const bool is_told = now.is_told != 0.0;
  if (!is_told && !(norm(last.linear) <= fastest)) return put(FrameSample(now));
  int alike = 1;  // samples that tell their velocities, or do not
  while (alike < known && (samples[alike].is_told != 0.0) == is_told) ++alike;
  if (alike >= (is_told ? 3 : 4)) change = agreed(change_before(0), change_before(1));
  velocity = is_told ? now.velocity : last;
  if (is_told) return;
  velocity.linear = last.linear + change.linear * (0.5 * interval);
  velocity.angular = last.angular + change.angular * (0.5 * interval);
}

void FrameMotion::set(const FrameSample& sample, const FrameVelocity& change) {
  if (rests_at(sample)) return;
  put(sample);
  FrameMemory::change = change;
}

void FrameMotion::stop(double time) {
  if (moves(time)) put({time, at(time).pose.at, orientation_at(time)});
}

bool FrameMotion::rests_at(const FrameSample& sample) {
  FrameSample& last = samples[0];
  const Quaternion orientation = normalised(sample.orientation);
  const bool is_there = norm2(sample.at - last.at) == 0.0 && orientation.x == last.orientation.x &&
                        orientation.y == last.orientation.y && orientation.z == last.orientation.z &&
                        orientation.w == last.orientation.w;
  if (known == 0.0 || !is_there || moves(last.time) ||
      norm2(sample.velocity.linear) + norm2(sample.velocity.angular) > 0.0)
    return false;
  last.time = sample.time;
  return true;
}

void FrameMotion::shift_time(double by) {
  for (FrameSample& sample : samples) sample.time += by;
  revision_ = next_revision();
}

double FrameMotion::time_moved(double time, double& rate) const {
  const double since = time - samples[0].time, late = since - lasts, stops = STOPS_IN / LATE_AFTER * lasts;
  rate = 1.0;
  if (!(late > 0.0)) return since;
  if (late >= stops) {
    rate = 0.0;
    return lasts + 0.5 * stops;
  }
  rate = 1.0 - late / stops;
  return lasts + late - 0.5 * late * late / stops;
}

Quaternion FrameMotion::orientation_at(double time) const {
  double rate;
  const double t = time_moved(time, rate);
  return quaternion_of(velocity.angular * t + change.angular * (0.5 * t * t)) * samples[0].orientation;
}

FrameState FrameMotion::at(double time) const {
  double rate;
  const double t = time_moved(time, rate), half = 0.5 * t * t;
  FrameState found;
  found.pose.at = samples[0].at + velocity.linear * t + change.linear * half;
  found.pose.rotation = transpose(axes_of(orientation_at(time)));
  found.velocity.linear = (velocity.linear + change.linear * t) * rate;
  found.velocity.angular = (velocity.angular + change.angular * t) * rate;
  return found;
}

bool FrameMotion::moves(double time) const {
  double rate;
  time_moved(time, rate);
  return rate > 0.0 &&
         norm2(velocity.linear) + norm2(velocity.angular) + norm2(change.linear) + norm2(change.angular) > 0.0;
}

bool FrameMotion::recall(const FrameMemory& memory) {
  const auto *first = reinterpret_cast<const double*>(&memory.velocity),
             *end = reinterpret_cast<const double*>(&memory + 1);
  if (!(memory.known >= 0.0 && memory.known <= INTERVALS_KEPT + 1.0 && memory.lasts >= 0.0)) return false;
  if (!std::all_of(first, end, [](double number) { return std::isfinite(number); })) return false;
  static_cast<FrameMemory&>(*this) = memory, known = std::floor(memory.known);
  revision_ = next_revision();
  return true;
}

}  // namespace smartmesh
