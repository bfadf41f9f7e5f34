#include "ground/frame_motion.h"

#include <algorithm>
#include <cmath>

#include "map/motion.h"

namespace smartmesh {

namespace {

// Age of the last sample up to which a frame moves on, in intervals between samples, and the further time in which it
// stops.
constexpr double LATE_AFTER = 1.5, STOPS_IN = 3.0;

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

FrameVelocity difference(const FrameVelocity& a, const FrameVelocity& b, double rate) {
  return {(a.linear - b.linear) * rate, (a.angular - b.angular) * rate};
}

Vec3 agreed_by_axis(const Vec3& change, const Vec3& before) {
  return {agreed(change.x, before.x), agreed(change.y, before.y), agreed(change.z, before.z)};
}

}  // namespace

FrameVelocity agreed(const FrameVelocity& change, const FrameVelocity& before) {
  return {agreed_by_axis(change.linear, before.linear), agreed_by_axis(change.angular, before.angular)};
}

void FrameMotion::put(const FrameSample& sample) {
  samples_[0] = sample, samples_[0].orientation = normalised(sample.orientation), known_ = 1;
  velocity_ = sample.velocity.value_or(FrameVelocity{}), change_ = {};
  lasts_ = INFINITE;
  ++revision_;
}

void FrameMotion::note(const FrameSample& sample) {
  if (known_ == 0 || sample.time < time()) return put(sample);
  if (rests_at(sample)) return;
  if (sample.time != time()) {
    std::copy_backward(samples_.begin(), samples_.end() - 1, samples_.end());
    known_ = std::min(known_ + 1, 4);
  }
  samples_[0] = sample, samples_[0].orientation = normalised(sample.orientation);
  if (known_ > 1)
    estimate();
  else
    put(sample);
  ++revision_;
}

// Differences of velocities that are told hold between two samples; those of mean velocities, which hold in the middle
// of their intervals, between three.
FrameVelocity FrameMotion::change_before(int age) const {
  const FrameSample &now = samples_[age], &before = samples_[age + 1];
  if (now.velocity) return difference(*now.velocity, *before.velocity, 1.0 / (now.time - before.time));
  const FrameSample& first = samples_[age + 2];
  return difference(between(before, now), between(first, before), 2.0 / (now.time - first.time));
}

void FrameMotion::estimate() {
  const FrameSample &now = samples_[0], &before = samples_[1];
  const double interval = now.time - before.time;
  const FrameVelocity last = between(before, now);
  lasts_ = LATE_AFTER * interval, change_ = {};
  const bool is_told = now.velocity.has_value();
  if (!is_told && !(norm(last.linear) <= fastest)) return put(FrameSample(now));
  int alike = 1;  // samples that tell their velocities, or do not
  while (alike < known_ && samples_[alike].velocity.has_value() == is_told) ++alike;
  if (alike >= (is_told ? 3 : 4)) change_ = agreed(change_before(0), change_before(1));
  velocity_ = is_told ? *now.velocity : last;
  if (is_told) return;
  velocity_.linear = last.linear + change_.linear * (0.5 * interval);
  velocity_.angular = last.angular + change_.angular * (0.5 * interval);
}

void FrameMotion::set(const FrameSample& sample, const FrameVelocity& change) {
  if (rests_at(sample)) return;
  put(sample);
  change_ = change;
}

void FrameMotion::stop(double time) {
  if (moves(time)) put({time, at(time).pose.at, orientation_at(time), {}});
}

bool FrameMotion::rests_at(const FrameSample& sample) {
  const FrameVelocity told = sample.velocity.value_or(FrameVelocity{});
  const Quaternion orientation = normalised(sample.orientation);
  const bool is_there = norm2(sample.at - samples_[0].at) == 0.0 && orientation.x == samples_[0].orientation.x &&
                        orientation.y == samples_[0].orientation.y && orientation.z == samples_[0].orientation.z &&
                        orientation.w == samples_[0].orientation.w;
  if (known_ == 0 || !is_there || moves(samples_[0].time) || norm2(told.linear) + norm2(told.angular) > 0.0)
    return false;
  samples_[0].time = sample.time;
  return true;
}

void FrameMotion::shift_time(double by) {
  for (FrameSample& sample : samples_) sample.time += by;
  ++revision_;
}

double FrameMotion::time_moved(double time, double& rate) const {
  const double since = time - samples_[0].time, late = since - lasts_, stops = STOPS_IN / LATE_AFTER * lasts_;
  rate = 1.0;
  if (!(late > 0.0)) return since;
  if (late >= stops) {
    rate = 0.0;
    return lasts_ + 0.5 * stops;
  }
  rate = 1.0 - late / stops;
  return lasts_ + late - 0.5 * late * late / stops;
}

Quaternion FrameMotion::orientation_at(double time) const {
  double rate;
  const double t = time_moved(time, rate);
  return quaternion_of(velocity_.angular * t + change_.angular * (0.5 * t * t)) * samples_[0].orientation;
}

FrameState FrameMotion::at(double time) const {
  double rate;
  const double t = time_moved(time, rate), half = 0.5 * t * t;
  FrameState found;
  found.pose.at = samples_[0].at + velocity_.linear * t + change_.linear * half;
  found.pose.rotation = transpose(axes_of(orientation_at(time)));
  found.velocity.linear = (velocity_.linear + change_.linear * t) * rate;
  found.velocity.angular = (velocity_.angular + change_.angular * t) * rate;
  return found;
}

bool FrameMotion::moves(double time) const {
  double rate;
  time_moved(time, rate);
  return rate > 0.0 &&
         norm2(velocity_.linear) + norm2(velocity_.angular) + norm2(change_.linear) + norm2(change_.angular) > 0.0;
}

FrameMemory FrameMotion::memory() const {
  FrameMemory found{static_cast<double>(known_), lasts_, velocity_, change_, {}};
  for (std::size_t k = 0; k < samples_.size(); ++k) {
    const FrameSample& sample = samples_[k];
    found.samples[k] = {sample.time, sample.at, sample.orientation, static_cast<double>(sample.velocity.has_value()),
                        sample.velocity.value_or(FrameVelocity{})};
  }
  return found;
}

bool FrameMotion::recall(const FrameMemory& memory) {
  const auto *first = reinterpret_cast<const double*>(&memory.velocity),
             *end = reinterpret_cast<const double*>(&memory + 1);
  if (!(memory.known >= 0.0 && memory.known <= 4.0 && memory.lasts >= 0.0)) return false;
  if (!std::all_of(first, end, [](double number) { return std::isfinite(number); })) return false;
  known_ = static_cast<int>(memory.known), lasts_ = memory.lasts;
  velocity_ = memory.velocity, change_ = memory.change;
  for (std::size_t k = 0; k < samples_.size(); ++k) {
    const FrameMemory::Sample& sample = memory.samples[k];
    samples_[k] = {sample.time, sample.at, sample.orientation, {}};
    if (sample.is_told != 0.0) samples_[k].velocity = sample.velocity;
  }
  ++revision_;
  return true;
}

}  // namespace smartmesh
