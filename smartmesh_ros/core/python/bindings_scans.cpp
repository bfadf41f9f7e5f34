// What Python sees of height scans.
#include <algorithm>
#include <limits>

#include "ground/height_scan.h"
#include "python/bindings.h"

namespace smartmesh {
namespace {

// Largest coordinate of a scan and of its points [m], as in terrain/grid.py.
constexpr double MOST = 1e9;

bool are_possible(const double* values, std::size_t count) {
  return std::all_of(values, values + count, [](double value) { return std::abs(value) <= MOST; });
}

// Writes the heights (n, k) [m] of the highest ground at a pattern of points (k, 2) [m] in the frame of each pose (n,
// 3), position [m] and yaw [rad], at `time` [s]; NaN = no ground. There is none around a pose that is not finite.
void scan_heights_at(const nb::list& tiles, Doubles2 poses, Doubles2 pattern, double time, Array<double, 2> heights) {
  const std::size_t count = poses.shape(0), points = pattern.shape(0);
  check_table(poses, count, 3, "poses"), check_table(pattern, points, 2, "pattern");
  check_table(heights, count, points, "heights");
  if (!are_possible(pattern.data(), 2 * points))
    throw std::invalid_argument("the pattern must be finite and at most 1e9");
  finite(time, "the time");
  Tiles terrain;
  const nb::list kept = set_tiles_of(terrain, tiles);
  GroundReader ground = terrain.reader(time, INSTANT);
  ground.prepare(count * points);
  const ScanPattern scanned{pattern.data(), points};
  const double radius = scanned.radius();
  for (std::size_t k = 0; k < count; ++k) {
    const double* pose = poses.data() + 3 * k;
    double* row = heights.data() + points * k;
    if (are_possible(pose, 3))
      scan_heights(ground, {pose[0], pose[1], pose[2]}, scanned, radius, row);
    else
      std::fill_n(row, points, std::numeric_limits<double>::quiet_NaN());
  }
}

}  // namespace

void add_scans(nb::module_& m) {
  m.def("scan_heights", &scan_heights_at, "tiles"_a, "poses"_a.noconvert(), "pattern"_a.noconvert(), "time"_a,
        "heights"_a.noconvert());
}

}  // namespace smartmesh
