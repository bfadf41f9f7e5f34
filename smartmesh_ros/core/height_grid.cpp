#include "height_grid.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "noisy_motion.h"

namespace smartmesh {

namespace {

constexpr int BLOCK = 1 << BLOCK_SHIFT;

// Returns the length of a chord over the length of its arc, for an arc of `turn` [rad].
double chord(double turn) { return turn == 0.0 ? 1.0 : std::sin(0.5 * turn) / (0.5 * turn); }

}  // namespace

GridPose HeightGrid::pose_at(double time) const {
  double px = x, py = y, turned = yaw, slide_x = 0.0, slide_y = 0.0, spin = 0.0;
  if (track.interval != 0.0) {
    const Phase phase = phase_of(time, track.time, track.interval, 0.0, mode, clocks[0].delay);
    const double turn = track.spin * phase.along, along = phase.along * chord(turn);
    const double c = std::cos(0.5 * turn), s = std::sin(0.5 * turn);
    px += along * (track.x * c - track.y * s);
    py += along * (track.x * s + track.y * c);
    turned += turn;
    const double ct = std::cos(turn), st = std::sin(turn);
    slide_x = phase.rate * (track.x * ct - track.y * st);
    slide_y = phase.rate * (track.x * st + track.y * ct);
    spin = phase.rate * track.spin;
  }
  return {px, py, std::cos(turned), std::sin(turned), slide_x, slide_y, spin};
}

bool HeightGrid::moves(double time) const {
  if ((track.x != 0.0 || track.y != 0.0 || track.spin != 0.0) && goes_on(time, track.time, track.interval, clocks[0].delay))
    return true;
  const int blocks = ((rows + BLOCK - 1) >> BLOCK_SHIFT) * block_columns;
  for (int k = 0; k < blocks; ++k) {
    if (mode == Mode::Correct ? remaining(clocks[k], shown, settle) > 0.0
                              : clocks[k].known > 0 && goes_on(time, clocks[k].time, clocks[k].lifetime, clocks[k].delay))
      return true;
  }
  return false;
}

double remaining(const Clock& clock, double shown, double settle) {
  const double elapsed = shown - clock.middle;
  if (!(elapsed < settle)) return 0.0;
  return 1.0 - std::max(elapsed, 0.0) / settle;
}

Sample GridReader::read(int row, int column) {
  if (!grid_.has(row, column)) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const Clock& clock = grid_.clock(row, column);
  if (&clock != clock_) {
    clock_ = &clock;
    left_ = grid_.mode == Mode::Correct ? remaining(clock, grid_.shown, grid_.settle) : 0.0;
    phase_ = block_phase(clock, time_, grid_.mode);
  }
  const std::size_t i = grid_.index(row, column);
  const double height = grid_.z + static_cast<double>(grid_.heights[i]);
  if (grid_.mode == Mode::Correct) return {height + left_ * static_cast<double>(grid_.offsets[i]), 0.0};
  if (clock.known == 0) return {height, 0.0};
  const Motion motion = motion_at(grid_, row, column, clock, phase_);
  return {height + displacement(motion, phase_), rise_of(motion, phase_, ahead_)};
}

}  // namespace smartmesh
