// Reader of a moving height map: the height and the rise of a sample at an instant.
#pragma once

#include <atomic>
#include <cmath>
#include <cstddef>

#include "map/material.h"
#include "map/motion.h"
#include "math/vec3.h"

namespace smartmesh {

// The number of the last change of any map.
inline std::atomic<long>& last_revision() {
  static std::atomic<long> last{0};
  return last;
}

// Returns a number higher than all before. Whatever changes takes one, so that whoever has seen a number knows whether
// it has seen the change.
inline long next_revision() { return ++last_revision(); }

// Side of the square blocks of samples that share one clock [samples], as the exponent of two.
constexpr int BLOCK_SHIFT = 6;

// Horizontal motion of a grid as a rigid body, see terrain/grid_track.py. `interval` [s]: longest expected time until
// the next map, zero at rest.
struct GridTrack {
  double time = 0.0, interval = 0.0, x = 0.0, y = 0.0, spin = 0.0;
};

// Fractional row and column of a point.
struct GridPoint {
  double row, column;
};

// Pose of a grid at one instant. `x`, `y` [m]: of sample (0, 0). `slide_x`, `slide_y` [m/s], `spin` [rad/s]: velocity.
struct GridPose {
  double x = 0.0, y = 0.0, cos = 1.0, sin = 0.0, slide_x = 0.0, slide_y = 0.0, spin = 0.0;

  // Returns the point at a place of a grid, at the height `z` [m].
  Vec3 point(const GridPoint& place, double resolution, double z = 0.0) const {
    const double u = place.column * resolution, v = place.row * resolution;
    return {x + u * cos - v * sin, y + u * sin + v * cos, z};
  }
  // Returns the pose of a window of the grid that starts at a place.
  GridPose from(const GridPoint& place, double resolution) const {
    const Vec3 corner = point(place, resolution), velocity = slide(corner.x, corner.y);
    return {corner.x, corner.y, cos, sin, velocity.x, velocity.y, spin};
  }
  // Returns true if the grid moves horizontally.
  bool slides() const { return slide_x != 0.0 || slide_y != 0.0 || spin != 0.0; }
  // Returns the horizontal velocity [m/s] and the spin [rad/s] of the grid at a point.
  Vec3 slide(double at_x, double at_y) const {
    return {slide_x - spin * (at_y - y), slide_y + spin * (at_x - x), spin};
  }
  // Returns the mean of the velocity over a duration [s] of what is at a point now: it moves along an arc.
  Vec3 mean_slide(double at_x, double at_y, double duration) const {
    const Vec3 v = slide(at_x, at_y);
    const double half = 0.5 * spin * duration;
    if (half == 0.0) return v;
    const double chord = std::sin(half) / half, c = chord * std::cos(half), s = chord * std::sin(half);
    return {c * v.x - s * v.y, s * v.x + c * v.y, spin};
  }
};

inline GridPoint to_grid(const GridPose& pose, double resolution, double x, double y) {
  const double dx = (x - pose.x) / resolution, dy = (y - pose.y) / resolution;
  return {dy * pose.cos - dx * pose.sin, dx * pose.cos + dy * pose.sin};
}

// Height [m] of a sample at an instant, NaN = no ground, and its rise [m] within a duration.
struct Sample {
  double height, rise;
};

// Samples of a height map and their motion; the arrays are in a MapMemory.
//
// `heights` (rows, columns) [m], NaN = hole. `velocities` (KEPT, rows, columns) [m/s]: a ring buffer, whose newest
// index is in the clock of each block. `offsets` (rows, columns) [m]: old minus new heights of corrections; of other
// ground, the deviations when the last map came of what was shown from the motion of that map, and `rates` (rows,
// columns) [m/s] those of its velocity, see Blend. `clocks`: one for each block. `x`, `y`, `z` [m]: position of sample
// (0, 0) at the last map; z is added to every height. `yaw` [rad]: of the grid. `settle` [s]: see MotionConfig in
// terrain/motion.py. `noise` [m]: standard deviation of the heights for the estimation of velocities. Corrections are
// blended in up to the instant `shown`, all of them at `settled` [s]. `variances` (rows, columns) [m^2]: of fused
// heights; null: exact.
struct HeightGrid : MotionRules {
  float* heights = nullptr;
  float* velocities = nullptr;
  float* offsets = nullptr;
  float* rates = nullptr;
  Clock* clocks = nullptr;
  const float* variances = nullptr;
  MaterialLayers materials;
  int rows = 0, columns = 0, block_columns = 0;
  double x = 0.0, y = 0.0, z = 0.0, yaw = 0.0, resolution = 1.0;
  double settle = 0.0, noise = 0.0, settled = -INFINITE;
  GridTrack track;
  long revision = next_revision();  // changes with every update, with the settings, and with what is shown

  std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) + static_cast<std::size_t>(column);
  }
  Material material_of(int row, int column) const { return materials.at(index(row, column)); }
  bool has(int row, int column) const { return row >= 0 && column >= 0 && row < rows && column < columns; }
  int blocks() const { return ((rows + (1 << BLOCK_SHIFT) - 1) >> BLOCK_SHIFT) * block_columns; }
  const Clock& clock(int row, int column) const {
    return clocks[(row >> BLOCK_SHIFT) * block_columns + (column >> BLOCK_SHIFT)];
  }

  GridPose pose_at(double time) const;

  // Blends corrections in up to the instant `shown` [s].
  void show(double shown);
  // Returns true if any sample may move at `time` [s].
  bool moves(double time) const;
};

// Returns the motion of a sample whose heights are noisy, of a block with this `clock` and `phase`; see
// noisy_motion.cpp. The clock's newest velocity must be one of those stored.
Motion motion_in_noise(const HeightGrid& grid, int row, int column, const Clock& clock, const Phase& phase);

// Reads samples of one grid at `time` [s] and their rise within the time `ahead` [s]. It keeps the phase of the last
// block, because neighbouring samples share it, and most blocks are updated at the same times.
class GridReader {
 public:
  GridReader(const HeightGrid& grid, double time, double ahead) : grid_(grid), time_(time), ahead_(ahead) {}
  Sample read(int row, int column);

  // Returns the height [m] of a sample inside the map, the same as that of `read`.
  double height(int row, int column) {
    const Clock& clock = grid_.clock(row, column);
    if (&clock != clock_) enter(clock);
    const std::size_t i = grid_.index(row, column);
    const double height = grid_.z + static_cast<double>(grid_.heights[i]);
    if (velocities_.newest == nullptr) return height + deviation(i);
    return height + displacement(motion(row, column, i), phase_) + deviation(i);
  }

  // Writes the heights [m] of `count` samples of a row from a column on; NaN beyond the edge and in holes. `rises` [m]:
  // of these samples, zero beyond the edge; null = not wanted.
  void read_row(int row, int column, int count, double* heights, double* rises = nullptr);

 private:
  void enter(const Clock& clock);
  template <class Use>
  void each_block(int row, int column, int count, const Use& use);
  template <class Use>
  void each_motion(int row, int column, int count, const Use& use) const;
  Motion motion(int row, int column, std::size_t i) const {
    return grid_.noise > 0.0 ? motion_in_noise(grid_, row, column, *clock_, phase_)
                             : velocities_.motion(i, phase_, grid_.max_velocity);
  }
  double deviation(std::size_t i) const {
    if (blend_.offset == 0.0) return 0.0;
    const double offset = blend_.offset * static_cast<double>(grid_.offsets[i]);
    return blend_.rate == 0.0 ? offset : offset + blend_.rate * static_cast<double>(grid_.rates[i]);
  }

  const HeightGrid& grid_;
  double time_, ahead_;
  const Clock* clock_ = nullptr;
  Phase phase_;
  Blend blend_;
  LastVelocities<float> velocities_;  // of the block
};

// Returns the share of a block's correction that is not yet blended in at the instant `shown` [s].
double remaining(const Clock& clock, double shown, double settle);

}  // namespace smartmesh
