#include "height_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "noisy_motion.h"

namespace smartmesh {

namespace {

// Returns the length of a chord over the length of its arc, for an arc of `turn` [rad].
double chord(double turn) { return turn == 0.0 ? 1.0 : std::sin(0.5 * turn) / (0.5 * turn); }

}  // namespace

GridPose HeightGrid::pose_at(double time) const {
  if (track.interval == 0.0) return {x, y, std::cos(yaw), std::sin(yaw), 0.0, 0.0, 0.0};
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

void HeightGrid::show(double instant) {
  const bool changes = mode == Mode::Correct && std::any_of(clocks, clocks + blocks(), [&](const Clock& clock) {
    return remaining(clock, shown, settle) != remaining(clock, instant, settle);
  });
  shown = instant;
  if (changes) ++revision;
}

void GridReader::enter(const Clock& clock) {
  const bool same = clock_ != nullptr && same_times(clock, *clock_);
  clock_ = &clock;
  if (same) return;
  left_ = grid_.mode == Mode::Correct ? remaining(clock, grid_.shown, grid_.settle) : 0.0;
  phase_ = block_phase(clock, time_, grid_.mode);
  newest_ = nullptr;
  if (grid_.mode == Mode::Correct || clock.known == 0 || clock.newest < 0 || clock.newest >= KEPT) return;
  const std::size_t size = static_cast<std::size_t>(grid_.rows) * static_cast<std::size_t>(grid_.columns);
  newest_ = grid_.velocities + size * static_cast<std::size_t>(clock.newest);
  second_ = grid_.velocities + size * static_cast<std::size_t>((clock.newest + KEPT - 1) % KEPT);
  third_ = grid_.velocities + size * static_cast<std::size_t>((clock.newest + KEPT - 2) % KEPT);
}

Motion GridReader::motion(int row, int column, std::size_t index) const {
  if (grid_.noise > 0.0) return motion_in_noise(grid_, row, column, *clock_, phase_);
  return motion_of(newest_[index], second_[index], third_[index], phase_, grid_.max_velocity);
}

Sample GridReader::read(int row, int column) {
  if (!grid_.has(row, column)) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const Clock& clock = grid_.clock(row, column);
  if (&clock != clock_) enter(clock);
  const std::size_t i = grid_.index(row, column);
  const double height = grid_.z + static_cast<double>(grid_.heights[i]);
  if (grid_.mode == Mode::Correct) return {height + left_ * static_cast<double>(grid_.offsets[i]), 0.0};
  if (newest_ == nullptr) return {height, 0.0};
  const Motion found = motion(row, column, i);
  return {height + displacement(found, phase_), rise_of(found, phase_, ahead_)};
}

void GridReader::read_row(int row, int column, int count, double* heights, double* rises) {
  std::fill(heights, heights + count, std::numeric_limits<double>::quiet_NaN());
  if (rises != nullptr) std::fill(rises, rises + count, 0.0);
  if (row < 0 || row >= grid_.rows) return;
  const int last = std::min(column + count, grid_.columns);
  for (int c = std::max(column, 0), end; c < last; c = end) {
    end = std::min(last, ((c >> BLOCK_SHIFT) + 1) << BLOCK_SHIFT);
    const Clock& clock = grid_.clock(row, c);
    if (&clock != clock_) enter(clock);
    const float* known = grid_.heights + grid_.index(row, c);
    double* out = heights + (c - column);
    for (int k = 0; k < end - c; ++k) out[k] = grid_.z + static_cast<double>(known[k]);
    add_motion(row, c, end - c, out, rises == nullptr ? nullptr : rises + (c - column));
  }
}

// Adds corrections and motion to the heights of samples of one block, and writes their rises.
void GridReader::add_motion(int row, int column, int count, double* heights, double* rises) const {
  const std::size_t i = grid_.index(row, column);
  if (left_ > 0.0)
    for (int k = 0; k < count; ++k) heights[k] += left_ * static_cast<double>(grid_.offsets[i + k]);
  if (newest_ == nullptr) return;
  const Phase phase = phase_;  // a copy, which the arrays cannot overlap
  const bool is_moved = phase.along != 0.0 || phase.bend != 0.0, rising = rises != nullptr && phase.left > 0.0;
  if (grid_.noise > 0.0) {
    for (int k = 0; k < count && (is_moved || rising); ++k) {
      const Motion found = motion_in_noise(grid_, row, column + k, *clock_, phase);
      heights[k] += displacement(found, phase);
      if (rising) rises[k] = rise_of(found, phase, ahead_);
    }
    return;
  }
  const float *v = newest_ + i, *v1 = second_ + i, *v2 = third_ + i;
  const double most = grid_.max_velocity, ahead = ahead_;
  if (is_moved)
    for (int k = 0; k < count; ++k) heights[k] += displacement(motion_of(v[k], v1[k], v2[k], phase, most), phase);
  if (rising)
    for (int k = 0; k < count; ++k) rises[k] = rise_of(motion_of(v[k], v1[k], v2[k], phase, most), phase, ahead);
}

}  // namespace smartmesh
