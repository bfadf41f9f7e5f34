// What Python sees of shapes of bodies, and the ground near them.
#include <nanobind/stl/vector.h>

#include "below_ground.h"
#include "body_tables.h"
#include "correction.h"

namespace smartmesh {
namespace {

using Bytes2Out = Array<std::uint8_t, 2>;
using Corners = Array<const std::int32_t, 2>;

constexpr std::size_t MOST_SAMPLES = 1u << 12;  // on a side of a rectangle

// Records of SUPPORT as bytes.
struct Supports {
  SupportRecord* records;
  std::int64_t count;

  explicit Supports(const Bytes2Out& bytes)
      : records(records_of<SupportRecord>(bytes, "supports")), count(static_cast<std::int64_t>(bytes.shape(0))) {}
  SupportRecord& at(std::int64_t slot) const {
    require(slot >= 0 && slot < count, "a slot has no support");
    return records[slot];
  }
};

// Returns how far points (n, 3) are outside the hull of the points `kept` (k, 3) [m], zero for those inside.
void distances_outside(const Doubles2& kept, const Doubles2& points, const Array<double, 1>& found) {
  check_table(kept, kept.shape(0), 3, "kept"), check_table(points, points.shape(0), 3, "points");
  check_list(found, points.shape(0), "found");
  require(kept.shape(0) > 0, "a hull has at least one point");
  Shape shape;
  shape.kind = ShapeKind::Hull, shape.rows = static_cast<std::int64_t>(kept.shape(0));
  const Solid hull(shape, {}, rows_of<Vec3>(kept));
  for (std::size_t k = 0; k < points.shape(0); ++k) found.data()[k] = distance_of_point(rows_of<Vec3>(points)[k], hull);
}

using Lifts = std::vector<std::tuple<std::int64_t, double, double>>;

// Returns slot, lift [m] and the ground's vertical velocity [m/s] of those bodies in `slots` that are below the ground.
Lifts find_below(const Shapes& shapes, const Doubles2& states, const Slots& slots, const nb::list& tiles, double time) {
  finite(time, "the time");
  check_alignment(slots.data(), sizeof(std::int64_t));
  const Bodies bodies(shapes, states);
  Surface surface;
  set_tiles_of(surface, tiles);
  SurfaceReader reader = surface.reader(time, INSTANT);
  BodySolid body;
  Lifts lifts;
  for (std::size_t k = 0; k < slots.shape(0); ++k) {
    const std::int64_t slot = slots.data()[k];
    const GroundPoint ground = ground_above(reader, Solid(bodies.shape(slot), bodies.states[slot].pose).centre);
    if (std::isnan(ground.height)) continue;
    bodies.place(slot, body);
    lifts.emplace_back(slot, ground.height - body.lowest(), ground.velocity.z);
  }
  return lifts;
}

// Writes the foot, normal and motion of the ground of the bodies in `slots` (n,), from samples (n, rows, columns) of their
// rectangles on a height map.
void find_feet(const Grid& grid, const Shapes& shapes, const Doubles2& states, const Slots& slots, const Doubles3& heights,
               const Doubles3& velocities, double time, const Bytes2Out& supports_s) {
  finite(time, "the time");
  check_alignment(slots.data(), sizeof(std::int64_t));
  check_alignment(heights.data(), sizeof(double)), check_alignment(velocities.data(), sizeof(double));
  const std::size_t rows = heights.shape(1), columns = heights.shape(2);
  require(rows >= 2 && columns >= 2 && rows <= MOST_SAMPLES && columns <= MOST_SAMPLES,
          "a rectangle has 2 to 4096 rows and columns");
  require(heights.shape(0) == slots.shape(0) && velocities.shape(0) == slots.shape(0) && velocities.shape(1) == rows &&
              velocities.shape(2) == columns,
          "there must be a height and a velocity for each sample of each body");
  const Bodies bodies(shapes, states);
  const Supports supports(supports_s);
  const GridPose pose = grid.grid.pose_at(time);
  BodySolid body;
  for (std::size_t k = 0; k < slots.shape(0); ++k) {
    bodies.place(slots.data()[k], body);
    const std::size_t first = k * rows * columns;
    const FieldSamples samples{heights.data() + first, velocities.data() + first, static_cast<int>(rows),
                            static_cast<int>(columns)};
    find_foot(samples, pose, grid.grid.resolution, body, supports.at(slots.data()[k]));
  }
}

// Writes the foot and normal of the ground of the body in a slot, from triangles (T, 3) among points (K, 3) [m].
void find_mesh_foot(const Doubles2& points, const Corners& triangles, const Shapes& shapes, const Doubles2& states,
                    std::int64_t slot, const Bytes2Out& supports_s) {
  check_table(points, points.shape(0), 3, "points"), check_table(triangles, triangles.shape(0), 3, "triangles");
  std::vector<Vec3> corners;
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    const std::int32_t corner = triangles.data()[k];
    require(corner >= 0 && static_cast<std::size_t>(corner) < points.shape(0), "a triangle uses a point that is not there");
    corners.push_back(rows_of<Vec3>(points)[corner]);
  }
  BodySolid body;
  Bodies(shapes, states).place(slot, body);
  find_foot(corners, body, Supports(supports_s).at(slot));
}

// A corrected tile: its map, and the instant up to which corrections were shown before [s].
using Corrected = std::tuple<const Grid*, double>;

// Moves the PyBullet bodies at `poses` (B, 7) with the corrections under the followers in `slots` (n,), which belong to the
// bodies `owners` (n,); returns the rows of the bodies that moved. `standing` (S,): those that touched the ground.
std::vector<std::size_t> move_with_corrections(const std::vector<Corrected>& tiles, const Shapes& shapes,
                                               const Doubles2& states, const Slots& slots, const Slots& owners,
                                               const Array<const bool, 1>& standing, double time, const States& poses) {
  finite(time, "the time");
  check_list(owners, slots.shape(0), "owners"), check_table(poses, poses.shape(0), 7, "poses");
  check_list(standing, states.shape(0), "standing");
  check_alignment(slots.data(), sizeof(std::int64_t));
  for (const Corrected& tile : tiles) require(std::get<0>(tile) != nullptr, "a corrected tile has no grid");
  const Bodies bodies(shapes, states);
  std::vector<CorrectionSums> sums(poses.shape(0));
  BodySolid body;
  for (std::size_t k = 0; k < slots.shape(0); ++k) {
    const std::int64_t slot = slots.data()[k], owner = owners.data()[k];
    require(owner >= 0 && owner < static_cast<std::int64_t>(sums.size()), "an owner has no pose");
    bodies.place(slot, body);
    const Vec3 origin = rows_of<BodyPose>(poses)[owner].at;
    for (const auto& [grid, shown] : tiles) {
      HeightGrid before = grid->grid;
      before.shown = shown;
      add_points_under(before, grid->grid, time, body, standing.data()[slot], origin, sums[owner]);
    }
  }
  std::vector<std::size_t> moved;
  for (std::size_t k = 0; k < sums.size(); ++k)
    if (move_with(sums[k], rows_of<BodyPose>(poses)[k])) moved.push_back(k);
  return moved;
}

}  // namespace

void add_bodies(nb::module_& m) {
  nb::class_<Shapes>(m, "Shapes")
      .def(nb::init<Bytes2, Bytes2, Doubles2>(), "shapes"_a.noconvert(), "parts"_a.noconvert(), "vertices"_a.noconvert());
  m.def("distances_outside", &distances_outside, "kept"_a.noconvert(), "points"_a.noconvert(), "found"_a.noconvert());
  m.def("find_below", &find_below, "shapes"_a, "states"_a.noconvert(), "slots"_a.noconvert(), "tiles"_a, "time"_a);
  m.def("find_feet", &find_feet, "grid"_a, "shapes"_a, "states"_a.noconvert(), "slots"_a.noconvert(),
        "heights"_a.noconvert(), "velocities"_a.noconvert(), "time"_a, "supports"_a.noconvert());
  m.def("find_mesh_foot", &find_mesh_foot, "points"_a.noconvert(), "triangles"_a.noconvert(), "shapes"_a,
        "states"_a.noconvert(), "slot"_a, "supports"_a.noconvert());
  m.def("move_with_corrections", &move_with_corrections, "tiles"_a, "shapes"_a, "states"_a.noconvert(),
        "slots"_a.noconvert(), "owners"_a.noconvert(), "standing"_a.noconvert(), "time"_a, "poses"_a.noconvert());
}

}  // namespace smartmesh
