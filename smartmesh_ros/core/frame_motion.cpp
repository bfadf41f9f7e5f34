#include "frame_motion.h"

#include <cmath>

namespace smartmesh {

namespace {

// Age of the last sample up to which a frame moves on, in intervals between samples, and the further time in which it stops.
constexpr double LATE_AFTER = 1.5, STOPS_IN = 3.0;

// Returns the rotation by a vector: about its direction, by its length [rad].
Turn turn_by(const Vec3& v) {
  const double angle = norm(v);
  const double share = angle > 1e-9 ? std::sin(0.5 * angle) / angle : 0.5;
  return {v.x * share, v.y * share, v.z * share, std::cos(0.5 * angle)};
}

// Returns the vector of the rotation that leads from one orientation to another the short way [rad].
Vec3 turned_from(const Turn& from, const Turn& to) {
  const Turn d = to * from.inverse();
  const Vec3 v = Vec3{d.x, d.y, d.z} * (d.w < 0.0 ? -1.0 : 1.0);
  const double sine = norm(v);
  return sine > 1e-12 ? v * (2.0 * std::atan2(sine, std::abs(d.w)) / sine) : v * 2.0;
}

Turn normalised(const Turn& q) {
  const double scale = 1.0 / std::sqrt(dot(q, q));
  return {q.x * scale, q.y * scale, q.z * scale, q.w * scale};
}

// Returns the mean velocity between two samples.
FrameVelocity between(const FrameSample& before, const FrameSample& after) {
  const double rate = 1.0 / (after.time - before.time);
  return {(after.at - before.at) * rate, turned_from(before.turn, after.turn) * rate};
}

FrameVelocity difference(const FrameVelocity& a, const FrameVelocity& b, double rate) {
  return {(a.linear - b.linear) * rate, (a.angular - b.angular) * rate};
}

}  // namespace

void FrameMotion::put(const FrameSample& sample) {
  now_ = sample, now_.turn = normalised(sample.turn), known_ = 1;
  velocity_ = sample.velocity.value_or(FrameVelocity{}), change_ = {};
  lasts_ = std::numeric_limits<double>::infinity();
  ++revision_;
}

void FrameMotion::note(const FrameSample& sample) {
  if (known_ == 0 || sample.time < now_.time) return put(sample);
  if (rests_at(sample)) return;
  if (sample.time != now_.time) {
    first_ = before_, before_ = now_;
    known_ = std::min(known_ + 1, 3);
  }
  now_ = sample, now_.turn = normalised(sample.turn);
  if (known_ > 1) estimate();
  else put(sample);
  ++revision_;
}

void FrameMotion::estimate() {
  const double interval = now_.time - before_.time;
  const FrameVelocity last = between(before_, now_);
  lasts_ = LATE_AFTER * interval, change_ = {};
  if (now_.velocity) {
    velocity_ = *now_.velocity;
    if (before_.velocity) change_ = difference(velocity_, *before_.velocity, 1.0 / interval);
    return;
  }
  if (!(norm(last.linear) <= fastest)) return put(now_);
  velocity_ = last;
  if (known_ < 3) return;
  // Both velocities hold in the middle of their intervals.
  change_ = difference(last, between(first_, before_), 2.0 / (now_.time - first_.time));
  velocity_.linear = last.linear + change_.linear * (0.5 * interval);
  velocity_.angular = last.angular + change_.angular * (0.5 * interval);
}

void FrameMotion::set(const FrameSample& sample, const FrameVelocity& change) {
  if (rests_at(sample)) return;
  put(sample);
  change_ = change;
}

void FrameMotion::stop(double time) {
  if (!moves(time)) return;
  now_.at = at(time).pose.at, now_.turn = turn_at(time), now_.time = time;
  now_.velocity.reset();
  put(FrameSample(now_));
}

bool FrameMotion::rests_at(const FrameSample& sample) {
  const FrameVelocity told = sample.velocity.value_or(FrameVelocity{});
  const Turn turn = normalised(sample.turn);
  const bool is_there = norm2(sample.at - now_.at) == 0.0 && turn.x == now_.turn.x && turn.y == now_.turn.y &&
                        turn.z == now_.turn.z && turn.w == now_.turn.w;
  if (known_ == 0 || !is_there || moves(now_.time) || norm2(told.linear) + norm2(told.angular) > 0.0) return false;
  now_.time = sample.time;
  return true;
}

void FrameMotion::shift_time(double by) {
  now_.time += by, before_.time += by, first_.time += by;
  ++revision_;
}

double FrameMotion::time_moved(double time, double& rate) const {
  const double since = time - now_.time, late = since - lasts_, stops = STOPS_IN / LATE_AFTER * lasts_;
  rate = 1.0;
  if (!(late > 0.0)) return since;
  if (late >= stops) {
    rate = 0.0;
    return lasts_ + 0.5 * stops;
  }
  rate = 1.0 - late / stops;
  return lasts_ + late - 0.5 * late * late / stops;
}

Turn FrameMotion::turn_at(double time) const {
  double rate;
  const double t = time_moved(time, rate);
  return turn_by(velocity_.angular * t + change_.angular * (0.5 * t * t)) * now_.turn;
}

FrameState FrameMotion::at(double time) const {
  double rate;
  const double t = time_moved(time, rate), half = 0.5 * t * t;
  FrameState found;
  found.pose.at = now_.at + velocity_.linear * t + change_.linear * half;
  found.pose.turn = transpose(axes_of(turn_at(time)));
  found.velocity.linear = (velocity_.linear + change_.linear * t) * rate;
  found.velocity.angular = (velocity_.angular + change_.angular * t) * rate;
  return found;
}

bool FrameMotion::moves(double time) const {
  double rate;
  time_moved(time, rate);
  return rate > 0.0 && norm2(velocity_.linear) + norm2(velocity_.angular) + norm2(change_.linear) + norm2(change_.angular) > 0.0;
}

}  // namespace smartmesh
