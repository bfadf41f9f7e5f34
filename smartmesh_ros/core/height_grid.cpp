#include "height_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "noisy_motion.h"

namespace smartmesh {

namespace {

// The last three velocities of the samples of a row, newest first [m/s].
struct KeptRow {
  const float *newest, *before, *oldest;

  KeptRow(const HeightGrid& grid, int row, std::int64_t slot) {
    const auto start = [&](std::int64_t k) {
      const std::size_t size = static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.columns);
      return grid.velocities + static_cast<std::size_t>(k % KEPT) * size + grid.index(row, 0);
    };
    newest = start(slot), before = start(slot + KEPT - 1), oldest = start(slot + KEPT - 2);
  }
  Motion motion(int column, const Phase& phase, double most) const {
    return motion_of(static_cast<double>(newest[column]), static_cast<double>(before[column]),
                     static_cast<double>(oldest[column]), phase, most);
  }
};

// Returns the length of a chord over the length of its arc, for an arc of `turn` [rad].
double chord(double turn) { return turn == 0.0 ? 1.0 : std::sin(0.5 * turn) / (0.5 * turn); }

}  // namespace

void HeightGrid::place(const Vec3& origin, double turned, double spacing) {
  x = origin.x, y = origin.y, z = origin.z, yaw = turned, resolution = spacing;
  cos_yaw = std::cos(yaw), sin_yaw = std::sin(yaw);
}

GridPose HeightGrid::pose_at(double time) const {
  if (track.interval == 0.0) return {x, y, cos_yaw, sin_yaw, 0.0, 0.0, 0.0};
  const Phase phase = phase_of(time, track.time, track.interval, 0.0, mode, clocks[0].delay);
  const double turn = track.spin * phase.along, along = phase.along * chord(turn);
  const double c = std::cos(0.5 * turn), s = std::sin(0.5 * turn), ct = std::cos(turn), st = std::sin(turn);
  return {x + along * (track.x * c - track.y * s),
          y + along * (track.x * s + track.y * c),
          std::cos(yaw + turn),
          std::sin(yaw + turn),
          phase.rate * (track.x * ct - track.y * st),
          phase.rate * (track.x * st + track.y * ct),
          phase.rate * track.spin};
}

bool HeightGrid::moves(double time) const {
  if ((track.x != 0.0 || track.y != 0.0 || track.spin != 0.0) && goes_on(time, track.time, track.interval, clocks[0].delay))
    return true;
  for (int k = 0; k < blocks(); ++k) {
    if (mode == Mode::Correct ? remaining(clocks[k], shown, settle) > 0.0
                              : clocks[k].known > 0 && goes_on(time, clocks[k].time, clocks[k].lifetime, clocks[k].delay))
      return true;
  }
  return false;
}

double HeightGrid::lifetime() const {
  double newest = -std::numeric_limits<double>::infinity(), longest = track.interval;
  for (int k = 0; k < blocks(); ++k) newest = std::max(newest, clocks[k].time);
  for (int k = 0; k < blocks(); ++k)
    if (goes_on(newest, clocks[k].time, clocks[k].lifetime, clocks[k].delay)) longest = std::max(longest, clocks[k].lifetime);
  return longest;
}

double remaining(const Clock& clock, double shown, double settle) {
  const double elapsed = shown - clock.middle;
  if (!(elapsed < settle)) return 0.0;
  return 1.0 - std::max(elapsed, 0.0) / settle;
}

void GridReader::enter(const Clock& clock) {
  if (&clock == clock_) return;
  clock_ = &clock;
  left_ = grid_.mode == Mode::Correct ? remaining(clock, grid_.shown, grid_.settle) : 0.0;
  phase_ = block_phase(clock, time_, grid_.mode);
}

Sample GridReader::read(int row, int column) {
  if (!grid_.has(row, column)) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const Clock& clock = grid_.clock(row, column);
  enter(clock);
  const std::size_t i = grid_.index(row, column);
  const double height = grid_.z + static_cast<double>(grid_.heights[i]);
  if (grid_.mode == Mode::Correct) return {height + left_ * static_cast<double>(grid_.offsets[i]), 0.0};
  if (clock.known == 0) return {height, 0.0};
  const Motion motion = motion_at(grid_, row, column, clock, phase_);
  return {height + displacement(motion, phase_), rise_of(motion, phase_, ahead_)};
}

void GridReader::read_row(int row, int first, int end, double* heights) {
  const int left = std::clamp(first, 0, grid_.columns), right = std::clamp(end, left, grid_.columns);
  if (row < 0 || row >= grid_.rows || left == right) {
    std::fill(heights, heights + (end - first), std::numeric_limits<double>::quiet_NaN());
    return;
  }
  std::fill(heights, heights + (left - first), std::numeric_limits<double>::quiet_NaN());
  std::fill(heights + (right - first), heights + (end - first), std::numeric_limits<double>::quiet_NaN());
  const float* stored = grid_.heights + grid_.index(row, 0);
  for (int column = left; column < right;) {
    const int stop = std::min(right, ((column >> BLOCK_SHIFT) + 1) << BLOCK_SHIFT);
    const Clock& clock = grid_.clock(row, column);
    enter(clock);
    const bool moves = clock.known != 0 || grid_.mode == Mode::Correct;
    const bool is_plain = grid_.mode != Mode::Correct && grid_.noise <= 0.0 && clock.newest >= 0 && clock.newest < KEPT;
    if (moves && !is_plain) {
      for (; column < stop; ++column) heights[column - first] = read(row, column).height;
    } else if (!moves) {
      for (; column < stop; ++column) heights[column - first] = grid_.z + static_cast<double>(stored[column]);
    } else {
      const KeptRow kept(grid_, row, clock.newest);
      for (; column < stop; ++column)
        heights[column - first] = grid_.z + static_cast<double>(stored[column]) +
                                  displacement(kept.motion(column, phase_, grid_.max_velocity), phase_);
    }
  }
}

}  // namespace smartmesh
