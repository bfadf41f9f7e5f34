// What Python sees of shapes of bodies, and the ground near them.
#include <nanobind/stl/vector.h>

#include "python/body_tables.h"
#include "shape/gap.h"
#include "step/below_ground.h"
#include "step/correction.h"

namespace smartmesh {
namespace {

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

// A corrected tile: its map, and the instant up to which corrections were shown before [s].
using Corrected = std::tuple<const Grid*, double>;

// Moves the PyBullet bodies at `poses` (B, 7) with the corrections under the followers in `slots` (n,), which belong to
// the bodies `owners` (n,); returns the rows of the bodies that moved. `standing` (S,): those that touched the ground.
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
      .def(nb::init<Bytes2, Bytes2, Doubles2>(), "shapes"_a.noconvert(), "parts"_a.noconvert(),
           "vertices"_a.noconvert());
  m.def("distances_outside", &distances_outside, "kept"_a.noconvert(), "points"_a.noconvert(), "found"_a.noconvert());
  m.def("find_below", &find_below, "shapes"_a, "states"_a.noconvert(), "slots"_a.noconvert(), "tiles"_a, "time"_a);
  m.def("move_with_corrections", &move_with_corrections, "tiles"_a, "shapes"_a, "states"_a.noconvert(),
        "slots"_a.noconvert(), "owners"_a.noconvert(), "standing"_a.noconvert(), "time"_a, "poses"_a.noconvert());
}

}  // namespace smartmesh
