// What Python sees of height scans.
#include "bindings.h"
#include "height_scan.h"

namespace smartmesh {
namespace {

// Largest coordinate of a scan and of its points [m], as in terrain/grid.py.
constexpr double MOST = 1e9;

void check_within(const double* values, std::size_t count, const char* name) {
  for (std::size_t k = 0; k < count; ++k)
    if (!(std::abs(values[k]) <= MOST))
      throw std::invalid_argument(std::string(name) + " must be finite and at most 1e9");
}

// Writes the heights (n, k) [m] of the highest ground at a pattern of points (k, 2) [m] in the frame of each pose (n, 3),
// position [m] and yaw [rad], at `time` [s]; NaN = no ground.
void scan_heights_at(const nb::list& tiles, Doubles2 poses, Doubles2 pattern, double time, Array<double, 2> heights) {
  const std::size_t count = poses.shape(0), points = pattern.shape(0);
  check_table(poses, count, 3, "poses"), check_table(pattern, points, 2, "pattern");
  check_table(heights, count, points, "heights");
  check_within(poses.data(), 3 * count, "poses"), check_within(pattern.data(), 2 * points, "pattern");
  finite(time, "the time");
  Surface surface;
  const nb::list kept = set_tiles_of(surface, tiles);
  SurfaceReader ground = surface.reader(time, INSTANT);
  ground.prepare(count * points);
  const ScanPattern scanned{pattern.data(), points};
  const double radius = scanned.radius();
  for (std::size_t k = 0; k < count; ++k) {
    const double* pose = poses.data() + 3 * k;
    scan_heights(ground, {pose[0], pose[1], pose[2]}, scanned, radius, heights.data() + points * k);
  }
}

}  // namespace

void add_scans(nb::module_& m) {
  m.def("scan_heights", &scan_heights_at, "tiles"_a, "poses"_a.noconvert(), "pattern"_a.noconvert(), "time"_a,
        "heights"_a.noconvert());
}

}  // namespace smartmesh
