// Motion of a frame with all six degrees of freedom, second order in time.
#pragma once

#include "map/motion.h"
#include "math/rotation.h"
#include "math/vec3.h"

namespace smartmesh {

// Velocity of a frame's origin [m/s], and its angular velocity [rad/s], in the world.
struct FrameVelocity {
  Vec3 linear, angular;
};

// A frame at one instant.
struct FrameState {
  Pose pose;
  FrameVelocity velocity;

  // Returns the velocity of a point of the world that moves with the frame [m/s].
  Vec3 velocity_at(const Vec3& p) const { return velocity.linear + cross(velocity.angular, p - pose.at); }
};

// Where a frame was at a time [s], and its velocity if it `is_told`, as numbers; zero = it is not.
struct FrameSample {
  double time = 0.0;
  Vec3 at;
  Quaternion orientation;
  double is_told = 0.0;
  FrameVelocity velocity;
};

// All that a frame goes on from, as numbers. `known`: of the samples, newest first. `lasts` [s]: age of the last sample
// up to which the frame moves on; then it stops.
struct FrameMemory {
  double known = 0.0, lasts = 0.0;
  FrameVelocity velocity, change;
  FrameSample samples[INTERVALS_KEPT + 1];
};

// From the last sample on a frame moves with a constant acceleration and angular acceleration, which come from the last
// three poses, or from the last two velocities where they are told, as far as the change before agrees.
class FrameMotion : FrameMemory {
 public:
  // Speed above which a frame without told velocities has jumped [m/s].
  double fastest = 100.0;

  // Takes a sample. One of the time of the last, but for rounding, replaces it; one before it is another beginning.
  void note(const FrameSample& sample);
  // Puts the frame somewhere else, at rest unless its velocity is told.
  void put(const FrameSample& sample);
  // Sets the motion from a time on, without an end.
  void set(const FrameSample& sample, const FrameVelocity& change);
  // Lets the frame rest where it is at `time` [s].
  void stop(double time);
  void shift_time(double by);

  FrameState at(double time) const;
  bool moves(double time) const;
  double time() const { return samples[0].time; }
  // Returns the number of the last change.
  long revision() const { return revision_; }

  const FrameMemory& memory() const { return *this; }
  // Goes on from what `memory` returned; returns false, and changes nothing, if the numbers are none of a frame.
  bool recall(const FrameMemory& memory);

 private:
  void estimate();
  // Returns true if a frame at rest is where it was, and notes the time.
  bool rests_at(const FrameSample& sample);
  // Returns the time for which the frame has moved as from the last sample on, and the rate of it: a frame without
  // further samples slows down and stops.
  double time_moved(double time, double& rate) const;
  Quaternion orientation_at(double time) const;

  // Returns the change of the velocity between samples, which `age` more came after [m/s^2], [rad/s^2].
  FrameVelocity change_before(int age) const;

  long revision_ = 0;
};

}  // namespace smartmesh
