#include "step/correction.h"

#include <algorithm>
#include <cmath>

#include "ground/tiles.h"

namespace smartmesh {

namespace {

// Largest height of a body's lowest point above the ground at which the body moves with a correction [m]. High enough
// for stacked bodies, so that stacks stay whole.
constexpr double HIGHEST_MOVED = 1.0;
// Points on a side of the sampling grid under a shape.
constexpr int POINTS = 5;
// Share of a shape's rounding radius by which the sampling grid is wider than its core. Small, because a ball touches
// the ground at one point.
constexpr double ROUNDED_SHARE = 0.25;
// Weight of links that do not stand on the ground, relative to links that do.
constexpr double AIRBORNE_WEIGHT = 1e-6;
// Points determine no plane if their spread along one direction is less than this share of the spread along the other
// (ratio of the determinant of their second moments to the squared trace).
constexpr double THIN = 1e-4;
// Sine of the angle between the axis of a round shape and the vertical from which on one of its other axes is made
// level.
constexpr double UPRIGHT = 1e-6;

// Plane fitted to values at points: their mean, and the slopes along x and y.
struct Plane {
  double mean, x, y;
};

Plane fitted(const CorrectionSums& s, double value, double x_value, double y_value) {
  const double xx = s.xx - s.x * s.x / s.n, xy = s.xy - s.x * s.y / s.n, yy = s.yy - s.y * s.y / s.n;
  const double xz = x_value - s.x * value / s.n, yz = y_value - s.y * value / s.n;
  const double determinant = xx * yy - xy * xy;
  if (determinant <= THIN * (xx + yy) * (xx + yy)) return {value / s.n, 0.0, 0.0};
  return {value / s.n, (xz * yy - yz * xy) / determinant, (yz * xx - xz * xy) / determinant};
}

bool is_round(ShapeKind kind) {
  return kind == ShapeKind::Capsule || kind == ShapeKind::Cylinder || kind == ShapeKind::Ball;
}

// Returns the two most level axes of a solid, as long as the half extents of the sampling grid along them [m].
void level_axes(const Solid& solid, Vec3 (&level)[2]) {
  const double wider = ROUNDED_SHARE * solid.shape->rounding;
  Vec3 u = solid.axes.row[0], v = solid.axes.row[1];
  const Vec3 w = solid.axes.row[2];
  const double aside = std::hypot(w.x, w.y);
  if (is_round(solid.shape->kind) && aside > UPRIGHT) u = {-w.y / aside, w.x / aside, 0.0}, v = cross(w, u);
  const Vec3 half = solid.shape->half;
  const Vec3 along[3] = {u * (half.x + wider), v * (half.y + wider), w * (half.z + wider)};
  int steepest = 2;
  if (std::abs(u.z) > std::abs(v.z) && std::abs(u.z) > std::abs(w.z))
    steepest = 0;
  else if (std::abs(v.z) > std::abs(w.z))
    steepest = 1;
  level[0] = along[steepest == 0 ? 1 : 0], level[1] = along[steepest == 2 ? 1 : 2];
}

// Returns the height of the ground under a point [m]; NaN beyond the map and over holes.
double height_under(const HeightGrid& grid, GridReader& reader, const GridPose& pose, const Vec3& p) {
  const GridPoint place = to_grid(pose, grid.resolution, p.x, p.y);
  if (!is_on(grid, place)) return NONE;
  return facet_at(grid, reader, clamped(grid, place), INSTANT).height;
}

}  // namespace

void CorrectionSums::add(double weight, double x_, double y_, double height_, double rise_) {
  n += weight, x += weight * x_, y += weight * y_;
  xx += weight * x_ * x_, xy += weight * x_ * y_, yy += weight * y_ * y_;
  height += weight * height_, x_height += weight * x_ * height_, y_height += weight * y_ * height_;
  rise += weight * rise_, x_rise += weight * x_ * rise_, y_rise += weight * y_ * rise_;
}

void add_points_under(const HeightGrid& before, const HeightGrid& after, double time, const BodyShape& shape,
                      const BodyPose& body, bool stands, const Vec3& origin, CorrectionSums& sums) {
  const Solid solid(shape.outline, body);
  const Vec3 centre = solid.centre;
  const GridPose pose = before.pose_at(time);
  GridReader reader(before, time, INSTANT), reader_after(after, time, INSTANT);
  const double above = shape.lowest(body) - height_under(before, reader, pose, centre);
  if (above > HIGHEST_MOVED || (!stands && std::isnan(above))) return;
  Vec3 level[2];
  level_axes(solid, level);
  for (int m = 0; m < POINTS; ++m) {
    for (int k = 0; k < POINTS; ++k) {
      const double s = 2.0 * m / (POINTS - 1) - 1.0, t = 2.0 * k / (POINTS - 1) - 1.0;
      const Vec3 p = centre + level[0] * s + level[1] * t;
      const double old = height_under(before, reader, pose, p), now = height_under(after, reader_after, pose, p);
      if (!std::isnan(old) && !std::isnan(now))
        sums.add(stands ? 1.0 : AIRBORNE_WEIGHT, p.x - origin.x, p.y - origin.y, old, now - old);
    }
  }
}

bool move_with(const CorrectionSums& sums, BodyPose& pose) {
  if (!(sums.n > 0.0)) return false;
  const double x0 = sums.x / sums.n, y0 = sums.y / sums.n;
  const Plane h = fitted(sums, sums.height, sums.x_height, sums.y_height);
  const Plane g = fitted(sums, sums.rise, sums.x_rise, sums.y_rise);
  if (g.mean == 0.0 && g.x == 0.0 && g.y == 0.0) return false;
  // The nearest point of the plane before the correction, relative to the body's position.
  const double over = (pose.at.z - (h.mean - h.x * x0 - h.y * y0)) / (1.0 + h.x * h.x + h.y * h.y);
  const Vec3 away{-h.x * over, -h.y * over, over};
  const double lift = g.mean + g.x * (-away.x - x0) + g.y * (-away.y - y0);
  // The shortest rotation from the normal before the correction to the normal after it.
  const double ax = -h.x, ay = -h.y, bx = -h.x - g.x, by = -h.y - g.y;
  const double x = ay - by, y = bx - ax, z = ax * by - ay * bx;
  const double w = std::sqrt((1.0 + ax * ax + ay * ay) * (1.0 + bx * bx + by * by)) + 1.0 + ax * bx + ay * by;
  const double length = std::sqrt(x * x + y * y + z * z + w * w);
  const Quaternion tilt{x / length, y / length, z / length, w / length};
  pose.at = pose.at + rotated(tilt, away) - away + Vec3{0.0, 0.0, lift};
  pose.orientation = tilt * pose.orientation;
  return true;
}

double correction(const GroundUnder& before, const GroundUnder& now, double lowest, int& count) {
  double sum = 0.0;
  int corrected = 0;
  for (std::size_t k = 0; k < std::min(before.heights.size(), now.heights.size()); ++k) {
    if (now.variances[k] < 0.0f || now.heights[k] == HOLE || before.heights[k] == HOLE) continue;
    if (lowest - before.heights[k] > HIGHEST_MOVED) continue;
    sum += now.heights[k] - before.heights[k];
    ++corrected;
  }
  count += corrected;
  return corrected > 0 ? sum / corrected : 0.0;
}

}  // namespace smartmesh
