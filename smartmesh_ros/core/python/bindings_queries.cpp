// What Python sees of queries of the ground: heights, facets, rays and scans.

#include "ground/ground_rays.h"
#include "mesh/mesh_reader.h"
#include "python/bindings.h"

namespace smartmesh {
namespace {

// Largest coordinate of a ray's origin or a scan, and the longest range of a ray [m], as in terrain/grid.py.
constexpr double MOST = 1e9;
constexpr Vec3 NOWHERE{NONE, NONE, NONE};

void check_instant(double time, double ahead) {
  finite(time, "the time");
  if (!(ahead > 0.0 && std::isfinite(ahead)))
    throw std::invalid_argument("the time ahead must be above zero and finite");
}

// Returns the heights [m] and vertical velocities [m/s] of the highest ground under points (N, 2) [m].
auto ground_heights(const KeptTiles& tiles, Rows<const Place> points, double time) {
  GroundReader reader = tiles.reader(time, points.size());
  std::vector<double> heights(points.size()), velocities(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto& [x, y] = points[k];
    const GroundSample ground = std::isfinite(x) && std::isfinite(y) ? reader.highest(x, y) : GroundSample{};
    heights[k] = ground.height, velocities[k] = ground.velocity.z;
  }
  return std::make_tuple(array_of(std::move(heights)), array_of(std::move(velocities)));
}

// Returns the ground below points (N, 3) [m]: heights, normals (N, 3), velocities (N, 3), ages and coefficients of
// friction; NaN = none.
auto ground_samples(const KeptTiles& tiles, Rows<const Vec3> points, double time) {
  GroundReader reader = tiles.reader(time, points.size());
  const std::size_t count = points.size();
  std::vector<double> heights(count), ages(count), friction(count);
  std::vector<Vec3> normals(count), velocities(count);
  for (std::size_t k = 0; k < count; ++k) {
    const Vec3& p = points[k];
    GroundSample ground = std::isfinite(p.x) && std::isfinite(p.y) ? reader.below(p) : GroundSample{};
    if (std::isnan(ground.height)) ground = {{NONE, NOWHERE}, NOWHERE, NONE, NONE};
    heights[k] = ground.height, normals[k] = ground.normal, velocities[k] = ground.velocity;
    ages[k] = ground.age, friction[k] = ground.friction;
  }
  return std::make_tuple(array_of(std::move(heights)), array_of(std::move(normals)), array_of(std::move(velocities)),
                         array_of(std::move(ages)), array_of(std::move(friction)));
}

// Writes the heights (n, k) [m] of the highest ground at a pattern of points (k, 2) [m] in the frame of each pose (n,
// 3), at `time` [s]; see `scan_heights`.
void scan_heights_at(const KeptTiles& tiles, Rows<const Vec3> poses, Rows<const Place> pattern, double time,
                     Array<double, 2> heights) {
  const std::size_t count = poses.size(), points = pattern.size();
  check_shape(heights, count, points, "heights");
  for (const auto& [x, y] : pattern)
    if (!(std::abs(x) <= MOST && std::abs(y) <= MOST))
      throw std::invalid_argument("the pattern must be finite and at most 1e9");
  GroundReader ground = tiles.reader(time, count * points);
  scan_heights(ground, poses.numbers(), count, pattern.numbers(), points, MOST, heights.data());
}

// Casts rays onto the tiles of a terrain of Python.
struct RayCaster {
  nb::object kept;
  const Tiles& terrain;
  GroundRays rays;

  explicit RayCaster(nb::object of) : kept(of), terrain(nb::cast<KeptTiles&>(of).tiles) {}
  RayCaster(const RayCaster&) = delete;

  // Returns the distances (N,) [m], infinity = nothing, and the normals (N, 3), NaN = nothing, where rays meet the
  // ground within `range` [m].
  auto cast(Rows<const Vec3> origins, Rows<const Vec3> directions, double range, double time) {
    const std::size_t count = origins.size();
    check_counts(count, directions);
    if (!(range > 0.0 && range <= MOST)) throw std::invalid_argument("the range must be above zero and at most 1e9 m");
    for (std::size_t k = 0; k < count; ++k) check_ray(origins[k], directions[k]);
    GroundReader ground = rays.begin(terrain, finite(time, "the time"));
    ground.prepare(count);
    std::vector<double> distances;
    std::vector<Vec3> normals;
    for (std::size_t k = 0; k < count; ++k) {
      const RayHit hit = rays.first_hit(ground, {origins[k], directions[k], range});
      distances.push_back(hit.distance), normals.push_back(std::isfinite(hit.distance) ? hit.normal : NOWHERE);
    }
    return std::make_tuple(array_of(std::move(distances)), array_of(std::move(normals)));
  }

  static void check_ray(const Vec3& from, const Vec3& way) {
    if (!(std::abs(from.x) <= MOST && std::abs(from.y) <= MOST && std::abs(from.z) <= MOST))
      throw std::invalid_argument("origins must be finite and at most 1e9 m away");
    if (!(std::abs(norm(way) - 1.0) < 1e-6)) throw std::invalid_argument("directions must have length one");
  }
};

// Returns the heights [m] and mean velocities [m/s] over the time `ahead` [s] of samples by their `indices` (n,) in the
// row-major map; NaN beyond it.
auto sample_grid(const Grid& grid, Slots indices, double time, double ahead) {
  check_instant(time, ahead);
  GridReader reader(grid.grid, time, ahead);
  const std::int64_t columns = grid.grid.columns, size = columns * grid.grid.rows;
  std::vector<double> heights(indices.size()), velocities(indices.size());
  for (std::size_t k = 0; k < indices.size(); ++k) {
    const std::int64_t i = indices[k];
    const Sample sample = i >= 0 && i < size ? reader.read(static_cast<int>(i / columns), static_cast<int>(i % columns))
                                             : Sample{NONE, 0.0};
    heights[k] = sample.height, velocities[k] = sample.rise / ahead;
  }
  return std::make_tuple(array_of(std::move(heights)), array_of(std::move(velocities)));
}

// Writes the heights (h, w) [m] of the window of samples that starts at a row and column; NaN beyond the edge.
void grid_window(const Grid& grid, int row, int column, double time, Array<double, 2> heights) {
  check_instant(time, INSTANT);
  constexpr int most = 1 << 29;
  if (row < -most || row > most || column < -most || column > most || heights.shape(0) > most ||
      heights.shape(1) > most)
    throw std::invalid_argument("a window has at most 2^29 rows and columns, and starts at most that far away");
  GridReader reader(grid.grid, time, INSTANT);
  const std::size_t wide = heights.shape(1);
  for (std::size_t a = 0; a < heights.shape(0); ++a)
    reader.read_row(row + static_cast<int>(a), column, static_cast<int>(wide), heights.data() + a * wide);
}

// Returns x, y [m], cosine and sine of the yaw, horizontal velocity (x, y) [m/s] and spin [rad/s] of a grid.
auto grid_pose(const Grid& grid, double time) {
  check_instant(time, INSTANT);
  const GridPose p = grid.grid.pose_at(time);
  return std::make_tuple(p.x, p.y, p.cos, p.sin, p.slide_x, p.slide_y, p.spin);
}

// Returns the positions (n, 3) [m] and mean velocities (n, 3) [m/s] over the time `ahead` [s] of vertices (n,).
auto sample_mesh(const Mesh& mesh, Slots indices, double time, double ahead) {
  check_instant(time, ahead);
  const MeshReader reader(mesh.surface, time, ahead);
  std::vector<Vec3> positions, velocities;
  for (const std::int64_t index : slots_below(indices, static_cast<std::size_t>(mesh.surface.vertices))) {
    const auto [position, way] = reader.read(static_cast<int>(index));
    positions.push_back(position), velocities.push_back({way.x / ahead, way.y / ahead, way.z / ahead});
  }
  return std::make_tuple(array_of(std::move(positions)), array_of(std::move(velocities)));
}

}  // namespace

void add_queries(nb::module_& m) {
  m.def("ground_heights", &ground_heights, "tiles"_a, "points"_a, "time"_a);
  m.def("ground_samples", &ground_samples, "tiles"_a, "points"_a, "time"_a);
  m.def("scan_heights", &scan_heights_at, "tiles"_a, "poses"_a, "pattern"_a, "time"_a, "heights"_a);
  nb::class_<RayCaster>(m, "RayCaster")
      .def(nb::init<nb::object>(), "tiles"_a)
      .def("cast", &RayCaster::cast, "origins"_a, "directions"_a, "range"_a, "time"_a);
  m.def("sample_grid", &sample_grid, "grid"_a, "indices"_a, "time"_a, "ahead"_a);
  m.def("grid_window", &grid_window, "grid"_a, "row"_a, "column"_a, "time"_a, "heights"_a);
  m.def("grid_pose", &grid_pose, "grid"_a, "time"_a);
  m.def("sample_mesh", &sample_mesh, "mesh"_a, "indices"_a, "time"_a, "ahead"_a);
}

}  // namespace smartmesh
