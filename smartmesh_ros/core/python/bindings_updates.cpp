// What Python sees of taking maps: motion, corrections, fusion, and the lattice that compares maps.
#include <cmath>
#include <vector>

#include "map/map_updates.h"
#include "map/sample_lattice.h"
#include "python/bindings.h"

namespace smartmesh {
namespace {

using Heights = Array<float, 2>;
using Pair = std::tuple<std::int64_t, std::int64_t>;

constexpr std::size_t MOST_SIDE = 1u << 24;
constexpr std::int64_t MOST_POINTS = 1024;
constexpr std::int64_t FARTHEST_SAMPLE = std::int64_t{1} << 52;

// Returns the rectangle of a map of some size whose first sample is given, for samples (h, w).
Region place_of(std::int64_t rows, std::int64_t columns, const Pair& first, const Floats2& samples) {
  const auto [row, column] = first;
  const auto high = static_cast<std::int64_t>(samples.shape(0)), wide = static_cast<std::int64_t>(samples.shape(1));
  if (row < 0 || column < 0 || high < 1 || wide < 1 || high > rows - row || wide > columns - column)
    throw std::invalid_argument("a rectangle is empty or leaves the map");
  return {row, column, row + high, column + wide};
}

// Returns true if any sample is infinite; NaN is none.
bool has_infinity(Floats2 samples) {
  const float* values = samples.data();
  const std::size_t count = samples.size();
  int found = 0;
  for (std::size_t k = 0; k < count; ++k) found |= std::isinf(values[k]);
  return found != 0;
}

// Writes `fresh` heights and `given` velocities (h, w), or None, of the rectangle whose first sample is `first`, as
// `take_heights`. `intervals`: as in Intervals [s].
void take_rectangle(Grid& grid, Pair first, Floats2 fresh, std::optional<Floats2> given, double time,
                    std::tuple<double, double> intervals) {
  if (given) check_shape(*given, fresh.shape(0), fresh.shape(1), "velocities");
  const Region place = place_of(grid.grid.rows, grid.grid.columns, first, fresh);
  const StepLock lock;
  take_heights(grid.writable(place), place, {fresh.data(), given ? given->data() : nullptr, finite(time, "the time")},
               {std::get<0>(intervals), std::get<1>(intervals)});
}

// Writes a new estimate (h, w) to the rectangle whose first sample is `first`, as `take_corrected`.
void correct(Grid& grid, Pair first, Floats2 known, double time) {
  const Region place = place_of(grid.grid.rows, grid.grid.columns, first, known);
  if (!(grid.grid.settle > 0.0)) throw std::invalid_argument("settle must be above zero");
  const StepLock lock;
  take_corrected(grid.writable(place), place, known.data(), finite(time, "the time"));
}

// Fuses the rectangle whose first sample is `first` with heights `measured` (h, w). `noises`: their variances (h, w),
// or (1, 1) = the same for all.
void fuse_at(Heights heights, Heights variances, Pair first, Floats2 measured, Floats2 noises, float grown,
             float gate_squared) {
  const std::size_t wide = measured.shape(1), columns = heights.shape(1);
  const bool same = noises.size() == 1;
  check_shape(variances, heights.shape(0), columns, "variances");
  if (!same) check_shape(noises, measured.shape(0), wide, "noises, which are not (1, 1),");
  const Region place =
      place_of(static_cast<std::int64_t>(heights.shape(0)), static_cast<std::int64_t>(columns), first, measured);
  const std::vector<float> all(same ? wide : 0, same ? noises.data()[0] : 0.0f);
  const StepLock lock;
  for (std::ptrdiff_t r = place.top; r < place.bottom; ++r) {
    const std::size_t at = static_cast<std::size_t>(r) * columns + static_cast<std::size_t>(place.left);
    const std::size_t from = static_cast<std::size_t>(r - place.top) * wide;
    fuse(heights.data() + at, variances.data() + at, measured.data() + from, same ? all.data() : noises.data() + from,
         wide, grown, gate_squared);
  }
}

// Writes new positions (3, n), and `given` velocities (3, n) or None, of the vertices `chosen` (n,) of a mesh, None =
// of all; see `take_vertices`. `intervals`: as in Intervals [s].
void move_vertices(Mesh& mesh, std::optional<Slots> chosen, Doubles2 fresh, std::optional<Doubles2> given, double time,
                   std::tuple<double, double> intervals) {
  const std::size_t count = fresh.shape(1), vertices = static_cast<std::size_t>(mesh.surface.vertices);
  check_shape(fresh, 3, chosen ? slots_below(*chosen, vertices).size() : vertices, "positions");
  if (given) check_shape(*given, 3, count, "velocities");
  for (std::size_t k = 0; k < fresh.size(); ++k) finite(fresh.data()[k], "positions");
  check_clock(mesh.surface.clock);
  const StepLock lock;
  take_vertices(mesh.surface,
                {chosen ? chosen->data() : nullptr, fresh.data(), given ? given->data() : nullptr,
                 static_cast<std::ptrdiff_t>(count), finite(time, "the time")},
                {std::get<0>(intervals), std::get<1>(intervals)});
}

PlacedMap placed(const Floats2& heights, double z, const Pair& first) {
  const auto [row, column] = first;
  const auto is_near = [](std::int64_t k) { return k >= -FARTHEST_SAMPLE && k <= FARTHEST_SAMPLE; };
  if (!is_near(row) || !is_near(column) || heights.shape(0) > MOST_SIDE || heights.shape(1) > MOST_SIDE)
    throw std::invalid_argument("a map is too large or too far away");
  return {
      heights.data(), static_cast<std::int64_t>(heights.shape(0)), static_cast<std::int64_t>(heights.shape(1)), z, row,
      column};
}

// Makes a lattice for maps of some rows and columns, with about so many `points` along each side.
void make_lattice(SampleLattice* made, std::int64_t rows, std::int64_t columns, std::int64_t points) {
  const auto most = static_cast<std::int64_t>(MOST_SIDE);
  if (rows < 0 || columns < 0 || rows > most || columns > most || points < 1 || points > MOST_POINTS)
    throw std::invalid_argument(
        "a lattice is for maps of at most 2^24 rows and columns, and has 1 to 1024 points a side");
  new (made) SampleLattice(rows, columns, points);
}

nb::tuple compare_maps(SampleLattice& lattice, Floats2 heights, double z, Pair first, double least) {
  const LatticeCounts n = lattice.compare(placed(heights, z, first), least);
  return nb::make_tuple(nb::make_tuple(n.known, n.changed, n.reversed, n.tilted, n.agreeing, n.tilt), n.median);
}

bool moved_as_one(const SampleLattice& lattice, Floats2 heights, double z, Pair first, double least) {
  return lattice.moved_as_one(placed(heights, z, first), least);
}

}  // namespace

void add_updates(nb::module_& m) {
  m.def("has_infinity", &has_infinity, "samples"_a);
  m.def("take_rectangle", &take_rectangle, "grid"_a, "first"_a, "fresh"_a, "given"_a, "time"_a, "intervals"_a);
  m.def("take_corrected", &correct, "grid"_a, "first"_a, "known"_a, "time"_a);
  m.def("fuse", &fuse_at, "heights"_a, "variances"_a, "first"_a, "measured"_a, "noises"_a, "grown"_a, "gate_squared"_a);
  m.def("move_vertices", &move_vertices, "mesh"_a, "chosen"_a, "fresh"_a, "given"_a, "time"_a, "intervals"_a);
  nb::class_<SampleLattice>(m, "SampleLattice")
      .def("__init__", &make_lattice, "rows"_a, "columns"_a, "points"_a)
      .def("compare", &compare_maps, "heights"_a, "z"_a, "first"_a, "least"_a)
      .def("moved_as_one", &moved_as_one, "heights"_a, "z"_a, "first"_a, "least"_a)
      .def("forget", &SampleLattice::forget);
}

}  // namespace smartmesh
