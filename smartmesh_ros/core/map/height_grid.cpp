#include "map/height_grid.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Returns the length of a chord over the length of its arc, for an arc of `angle` [rad].
double chord(double angle) {
  const double half = 0.5 * angle;  // of the least number it is zero
  return half == 0.0 ? 1.0 : std::sin(half) / half;
}

}  // namespace

GridPose HeightGrid::pose_at(double time) const {
  if (track.interval == 0.0) return {x, y, std::cos(yaw), std::sin(yaw), 0.0, 0.0, 0.0};
  const Phase phase = phase_of(time, track.time, track.interval, 0.0, mode, clocks[0].delay);
  const double angle = track.spin * phase.along, along = phase.along * chord(angle);
  const double c = std::cos(0.5 * angle), s = std::sin(0.5 * angle), ct = std::cos(angle), st = std::sin(angle);
  return {x + along * (track.x * c - track.y * s),
          y + along * (track.x * s + track.y * c),
          std::cos(yaw + angle),
          std::sin(yaw + angle),
          phase.rate * (track.x * ct - track.y * st),
          phase.rate * (track.x * st + track.y * ct),
          phase.rate * track.spin};
}

bool HeightGrid::moves(double time) const {
  if ((track.x != 0.0 || track.y != 0.0 || track.spin != 0.0) &&
      goes_on(time, track.time, track.interval, clocks[0].delay))
    return true;
  for (int k = 0; k < blocks(); ++k) {
    if (mode == Mode::Correct ? remaining(clocks[k], shown, settle) > 0.0 : may_move(clocks[k], time, mode))
      return true;
  }
  return false;
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
  if (changes) revision = next_revision();
}

void GridReader::enter(const Clock& clock) {
  const bool same = clock_ != nullptr && same_times(clock, *clock_);
  clock_ = &clock;
  if (same) return;
  blend_ = grid_.blend(clock, time_, ahead_);
  if (grid_.mode == Mode::Correct) blend_.offset = remaining(clock, grid_.shown, grid_.settle);
  phase_ = block_phase(clock, time_, grid_.mode);
  velocities_ = {};
  if (grid_.mode != Mode::Correct) velocities_ = {grid_.velocities, grid_.index(grid_.rows, 0), clock};
}

Sample GridReader::read(int row, int column) {
  if (!grid_.has(row, column)) return {NONE, 0.0};
  const Clock& clock = grid_.clock(row, column);
  if (&clock != clock_) enter(clock);
  const std::size_t i = grid_.index(row, column);
  const double height = grid_.z + static_cast<double>(grid_.heights[i]);
  if (velocities_.newest == nullptr) return {height + deviation(i), 0.0};
  const Motion found = motion(row, column, i);
  double rise = rise_of(found, phase_, ahead_);
  if (blend_.offset_change != 0.0)
    rise += blend_.offset_change * static_cast<double>(grid_.offsets[i]) +
            blend_.rate_change * static_cast<double>(grid_.rates[i]);
  return {height + displacement(found, phase_) + deviation(i), rise};
}

void GridReader::read_row(int row, int column, int count, double* heights, double* rises) {
  std::fill(heights, heights + count, NONE);
  if (rises != nullptr) std::fill(rises, rises + count, 0.0);
  const double ahead = ahead_;
  each_block(row, column, count, [&](int c, int inside) {
    const std::size_t i = grid_.index(row, c);
    const float* known = grid_.heights + i;
    double *out = heights + (c - column), *up = rises == nullptr ? nullptr : rises + (c - column);
    for (int k = 0; k < inside; ++k) out[k] = grid_.z + static_cast<double>(known[k]);
    const bool is_moved = phase_.along != 0.0 || phase_.bend != 0.0;
    if (is_moved || up != nullptr)
      each_motion(row, c, inside, [=](int k, const Motion& motion, const Phase& phase) {
        if (is_moved) out[k] += displacement(motion, phase);
        if (up != nullptr) up[k] = rise_of(motion, phase, ahead);
      });
    if (blend_.offset != 0.0)
      for (int k = 0; k < inside; ++k) out[k] += deviation(i + k);
    if (up == nullptr || blend_.offset_change == 0.0) return;
    for (int k = 0; k < inside; ++k)
      up[k] += blend_.offset_change * static_cast<double>(grid_.offsets[i + k]) +
               blend_.rate_change * static_cast<double>(grid_.rates[i + k]);
  });
}

// Calls `use(column, count)` for the samples of a row inside the map that are in one block each.
template <class Use>
void GridReader::each_block(int row, int column, int count, const Use& use) {
  if (row < 0 || row >= grid_.rows) return;
  const int last = std::min(column + count, grid_.columns);
  for (int c = std::max(column, 0), end; c < last; c = end) {
    end = std::min(last, ((c >> BLOCK_SHIFT) + 1) << BLOCK_SHIFT);
    const Clock& clock = grid_.clock(row, c);
    if (&clock != clock_) enter(clock);
    use(c, end - c);
  }
}

// Calls `use(k, motion, phase)` for samples of one block, if it has velocities.
template <class Use>
void GridReader::each_motion(int row, int column, int count, const Use& use) const {
  if (velocities_.newest == nullptr) return;
  if (grid_.noise > 0.0) {
    for (int k = 0; k < count; ++k) use(k, motion_in_noise(grid_, row, column + k, *clock_, phase_), phase_);
    return;
  }
  const std::size_t i = grid_.index(row, column);
  const float *v = velocities_.newest + i, *v1 = velocities_.second + i, *v2 = velocities_.third + i;
  const Phase phase = phase_;  // a copy, which what `use` writes to cannot overlap
  const double most = grid_.max_velocity;
  if (phase.third == 0.0)
    for (int k = 0; k < count; ++k) use(k, motion_of(v[k], v1[k], v2[k], phase, most), phase);
  else
    for (int k = 0; k < count; ++k) use(k, third_order_motion_of(v[k], v1[k], v2[k], phase, most), phase);
}

}  // namespace smartmesh
