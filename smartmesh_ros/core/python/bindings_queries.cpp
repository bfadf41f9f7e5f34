// What Python sees of queries of the ground: heights, facets, rays and scans.

#include "ground/ground_rays.h"
#include "ground/height_scan.h"
#include "mesh/mesh_reader.h"
#include "python/bindings.h"

namespace smartmesh {
namespace {

using Rows = Array<double, 1>;

// Largest coordinate of a ray's origin or a scan, and the longest range of a ray [m], as in terrain/grid.py.
constexpr double MOST = 1e9;

void check_instant(double time, double ahead) {
  finite(time, "the time");
  if (!(ahead > 0.0 && std::isfinite(ahead)))
    throw std::invalid_argument("the time ahead must be above zero and finite");
}

// Takes some tiles, and returns a reader of them at `time` [s] for `count` points.
GroundReader begin(KeptTiles& terrain, const nb::list& tiles, double time, std::size_t count) {
  terrain.set(tiles);
  GroundReader reader = terrain.tiles.reader(time, INSTANT);
  reader.prepare(count);
  return reader;
}

bool are_same(const nb::list& a, const nb::list& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t k = 0; k < a.size(); ++k)
    if (!a[k].is(b[k])) return false;
  return true;
}

void write(double* at, const Vec3& v) { at[0] = v.x, at[1] = v.y, at[2] = v.z; }

// Writes the heights [m] and vertical velocities [m/s] of the highest ground under points (N, 2) [m].
void ground_heights(const nb::list& tiles, Doubles2 points, double time, Rows heights, Rows velocities) {
  const std::size_t count = points.shape(0);
  check_table(points, count, 2, "points"), check_list(heights, count, "heights"),
      check_list(velocities, count, "velocities");
  check_instant(time, INSTANT);
  KeptTiles terrain;
  GroundReader reader = begin(terrain, tiles, time, count);
  for (std::size_t k = 0; k < count; ++k) {
    const double x = points.data()[2 * k], y = points.data()[2 * k + 1];
    const GroundPoint ground = std::isfinite(x) && std::isfinite(y) ? reader.at(x, y) : GroundPoint{NONE, {}};
    heights.data()[k] = ground.height, velocities.data()[k] = ground.velocity.z;
  }
}

// Writes the ground below points (N, 3) [m]: heights, normals (N, 3), velocities (N, 3), ages and coefficients of
// friction. Rows of points without ground stay as they are.
void ground_samples(const nb::list& tiles, Doubles2 points, double time, Rows heights, States normals,
                    States velocities, Rows ages, Rows friction) {
  const std::size_t count = points.shape(0);
  check_table(points, count, 3, "points"), check_list(heights, count, "heights"),
      check_table(normals, count, 3, "normals");
  check_table(velocities, count, 3, "velocities"), check_list(ages, count, "ages"),
      check_list(friction, count, "friction");
  check_instant(time, INSTANT);
  KeptTiles terrain;
  GroundReader reader = begin(terrain, tiles, time, count);
  for (std::size_t k = 0; k < count; ++k) {
    const double* p = points.data() + 3 * k;
    if (!(std::isfinite(p[0]) && std::isfinite(p[1]))) continue;
    const GroundSample ground = reader.below({p[0], p[1], p[2]});
    if (std::isnan(ground.height)) continue;
    heights.data()[k] = ground.height, ages.data()[k] = ground.age, friction.data()[k] = ground.friction;
    write(normals.data() + 3 * k, ground.normal), write(velocities.data() + 3 * k, ground.velocity);
  }
}

// Writes the heights (n, k) [m] of the highest ground at a pattern of points (k, 2) [m] in the frame of each pose (n,
// 3), at `time` [s]; see ground/height_scan.h.
void scan_heights_at(const nb::list& tiles, Doubles2 poses, Doubles2 pattern, double time, States heights) {
  const std::size_t count = poses.shape(0), points = pattern.shape(0);
  check_table(poses, count, 3, "poses"), check_table(pattern, points, 2, "pattern");
  check_table(heights, count, points, "heights");
  check_instant(time, INSTANT);
  for (std::size_t k = 0; k < pattern.size(); ++k)
    if (!(std::abs(pattern.data()[k]) <= MOST))
      throw std::invalid_argument("the pattern must be finite and at most 1e9");
  KeptTiles terrain;
  GroundReader ground = begin(terrain, tiles, time, count * points);
  scan_heights(ground, poses.data(), count, pattern.data(), points, MOST, heights.data());
}

// Casts rays onto grids and meshes.
struct RayCaster {
  KeptTiles terrain;
  GroundRays rays;

  RayCaster() = default;
  RayCaster(const RayCaster&) = delete;

  // Writes the distances (N,) [m], infinity = nothing, and the normals (N, 3) where rays meet the ground within `range`
  // [m]. Normals of other rays stay as they are.
  void cast(const nb::list& tiles, Doubles2 origins, Doubles2 directions, double range, double time, Rows distances,
            States normals) {
    const std::size_t count = origins.shape(0);
    check_table(origins, count, 3, "origins"), check_table(directions, count, 3, "directions");
    check_list(distances, count, "distances"), check_table(normals, count, 3, "normals");
    check_instant(time, INSTANT);
    if (!(range > 0.0 && range <= MOST)) throw std::invalid_argument("the range must be above zero and at most 1e9 m");
    for (std::size_t k = 0; k < count; ++k)
      check_ray(vector_at(origins.data() + 3 * k), vector_at(directions.data() + 3 * k));
    if (!are_same(terrain.kept, tiles)) terrain.set(tiles);
    GroundReader ground = rays.begin(terrain.tiles, time);
    ground.prepare(count);
    for (std::size_t k = 0; k < count; ++k) {
      const RayHit hit =
          rays.first_hit(ground, {vector_at(origins.data() + 3 * k), vector_at(directions.data() + 3 * k), range});
      distances.data()[k] = hit.distance;
      if (std::isfinite(hit.distance)) write(normals.data() + 3 * k, hit.normal);
    }
  }

  static void check_ray(const Vec3& from, const Vec3& way) {
    if (!(std::abs(from.x) <= MOST && std::abs(from.y) <= MOST && std::abs(from.z) <= MOST))
      throw std::invalid_argument("origins must be finite and at most 1e9 m away");
    if (!(std::abs(norm(way) - 1.0) < 1e-6)) throw std::invalid_argument("directions must have length one");
  }
};

// Writes the heights [m] and mean velocities [m/s] over the time `ahead` [s] of samples by their `indices` (n,) in the
// row-major map; NaN beyond it.
void sample_grid(const Grid& grid, Slots indices, double time, double ahead, Rows heights, Rows velocities) {
  const std::size_t count = indices.shape(0);
  check_list(indices, count, "indices"), check_list(heights, count, "heights"),
      check_list(velocities, count, "velocities");
  check_instant(time, ahead);
  GridReader reader(grid.grid, time, ahead);
  const std::int64_t columns = grid.grid.columns, size = columns * grid.grid.rows;
  for (std::size_t k = 0; k < count; ++k) {
    const std::int64_t i = indices.data()[k];
    const Sample sample = i >= 0 && i < size ? reader.read(static_cast<int>(i / columns), static_cast<int>(i % columns))
                                             : Sample{NONE, 0.0};
    heights.data()[k] = sample.height, velocities.data()[k] = sample.rise / ahead;
  }
}

// Writes the heights (h, w) [m] of the window of samples that starts at a row and column; NaN beyond the edge.
void grid_window(const Grid& grid, int row, int column, double time, States heights) {
  check_table(heights, heights.shape(0), heights.shape(1), "heights");
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

// Writes the positions (n, 3) [m] and mean velocities (n, 3) [m/s] over the time `ahead` [s] of vertices (n,).
void sample_mesh(const Mesh& mesh, Slots indices, double time, double ahead, States positions, States velocities) {
  const std::size_t count = indices.shape(0);
  check_list(indices, count, "indices"), check_table(positions, count, 3, "positions");
  check_table(velocities, count, 3, "velocities");
  check_instant(time, ahead);
  for (std::size_t k = 0; k < count; ++k)
    if (indices.data()[k] < 0 || indices.data()[k] >= mesh.surface.vertices)
      throw std::invalid_argument("an index is not that of a vertex");
  const MeshReader reader(mesh.surface, time, ahead);
  for (std::size_t k = 0; k < count; ++k) {
    const Vertex vertex = reader.read(static_cast<int>(indices.data()[k]));
    write(positions.data() + 3 * k, vertex.position);
    write(velocities.data() + 3 * k,
          {vertex.displacement.x / ahead, vertex.displacement.y / ahead, vertex.displacement.z / ahead});
  }
}

}  // namespace

void add_queries(nb::module_& m) {
  m.def("ground_heights", &ground_heights, "tiles"_a, "points"_a.noconvert(), "time"_a, "heights"_a.noconvert(),
        "velocities"_a.noconvert());
  m.def("ground_samples", &ground_samples, "tiles"_a, "points"_a.noconvert(), "time"_a, "heights"_a.noconvert(),
        "normals"_a.noconvert(), "velocities"_a.noconvert(), "ages"_a.noconvert(), "friction"_a.noconvert());
  m.def("scan_heights", &scan_heights_at, "tiles"_a, "poses"_a.noconvert(), "pattern"_a.noconvert(), "time"_a,
        "heights"_a.noconvert());
  nb::class_<RayCaster>(m, "RayCaster")
      .def(nb::init<>())
      .def("cast", &RayCaster::cast, "tiles"_a, "origins"_a.noconvert(), "directions"_a.noconvert(), "range"_a,
           "time"_a, "distances"_a.noconvert(), "normals"_a.noconvert());
  m.def("sample_grid", &sample_grid, "grid"_a, "indices"_a.noconvert(), "time"_a, "ahead"_a, "heights"_a.noconvert(),
        "velocities"_a.noconvert());
  m.def("grid_window", &grid_window, "grid"_a, "row"_a, "column"_a, "time"_a, "heights"_a.noconvert());
  m.def("grid_pose", &grid_pose, "grid"_a, "time"_a);
  m.def("sample_mesh", &sample_mesh, "mesh"_a, "indices"_a.noconvert(), "time"_a, "ahead"_a, "positions"_a.noconvert(),
        "velocities"_a.noconvert());
}

}  // namespace smartmesh
