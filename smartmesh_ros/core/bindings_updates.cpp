// What Python sees of taking maps: motion, corrections, fusion, and the lattice that compares maps.
#include <vector>

#include "bindings.h"
#include "fusion.h"
#include "map_corrections.h"
#include "map_updates.h"
#include "sample_lattice.h"

namespace smartmesh {
namespace {

using Heights = Array<float, 2>;
using Velocities = Array<float, 3>;
using Clocks = Array<std::uint8_t, 3>;
using Samples = Array<const float, 1>;
using Pair = std::tuple<std::int64_t, std::int64_t>;

constexpr std::size_t MOST_SIDE = 1u << 24;
constexpr std::int64_t FARTHEST_SAMPLE = std::int64_t{1} << 52;

// Refuses a clock whose numbers are no places in its arrays.
void check_clock(const Clock& clock) {
  if (clock.newest < 0 || clock.newest >= KEPT || clock.count < 0 || clock.count > INTERVALS_KEPT)
    throw std::invalid_argument("a clock names a velocity or an interval that is not there");
}

// Checks the clocks of the blocks that a rectangle touches. To check all of a large map takes longer than a small update.
void check_clocks(const MapArrays& map, const Region& place) {
  const Span down = blocks_of({place.top, place.bottom}), along = blocks_of({place.left, place.right});
  for (std::ptrdiff_t row = down.first; row < down.last; ++row)
    for (std::ptrdiff_t column = along.first; column < along.last; ++column)
      check_clock(map.clocks[row * map.block_columns + column]);
}

Clock* clocks_at(std::uint8_t* data) {
  check_alignment(data, alignof(Clock));
  return reinterpret_cast<Clock*>(data);
}

MapArrays map_of(const Heights& heights, const Clocks& clocks) {
  const std::size_t rows = heights.shape(0), columns = heights.shape(1);
  if (rows > MOST_SIDE || columns > MOST_SIDE) throw std::invalid_argument("a map has at most 2^24 rows and columns");
  if (clocks.shape(0) != (rows + 63) >> BLOCK_SHIFT || clocks.shape(1) != (columns + 63) >> BLOCK_SHIFT ||
      clocks.shape(2) != sizeof(Clock))
    throw std::invalid_argument("clocks must be records of CLOCK, one for each block of 64 x 64 samples");
  check_alignment(heights.data(), sizeof(float));
  MapArrays map;
  map.heights = heights.data();
  map.clocks = clocks_at(clocks.data());
  map.rows = static_cast<std::ptrdiff_t>(rows), map.columns = static_cast<std::ptrdiff_t>(columns);
  map.block_columns = static_cast<std::ptrdiff_t>(clocks.shape(1));
  return map;
}

// Returns the rectangles (n, 4) of a map, each given by its first row and column, last row and column, and checks their
// clocks.
std::vector<Region> rectangles_of(const Whole2& numbers, const MapArrays& map, std::size_t samples) {
  check_alignment(numbers.data(), sizeof(std::int64_t));
  if (numbers.shape(1) != 4) throw std::invalid_argument("rectangles must have the shape (n, 4)");
  std::vector<Region> found;
  std::size_t count = 0;
  for (std::size_t k = 0; k < numbers.shape(0); ++k) {
    const std::int64_t* n = numbers.data() + 4 * k;
    if (!(0 <= n[0] && n[0] <= n[2] && n[2] < map.rows && 0 <= n[1] && n[1] <= n[3] && n[3] < map.columns))
      throw std::invalid_argument("a rectangle is empty or leaves the map");
    found.push_back({n[0], n[1], n[2] + 1, n[3] + 1});
    check_clocks(map, found.back());
    count += static_cast<std::size_t>(found.back().size());
    if (count > samples) break;
  }
  if (count != samples) throw std::invalid_argument("the rectangles need another number of samples");
  return found;
}

// Writes `fresh` heights and `given` velocities (N,), or none (0,), as `take_heights`: those of one of the `rectangles`
// (n, 4) after the other, each row by row. `intervals`: as in Intervals [s].
void take_rectangles(Heights heights, Velocities velocities, Clocks clocks, Whole2 rectangles, Samples fresh,
                     Samples given, double time, std::tuple<double, double> intervals) {
  MapArrays map = map_of(heights, clocks);
  if (velocities.shape(0) != KEPT || velocities.shape(1) != heights.shape(0) || velocities.shape(2) != heights.shape(1))
    throw std::invalid_argument("velocities must have the shape (3, rows, columns)");
  if (given.size() != 0 && given.size() != fresh.size())
    throw std::invalid_argument("there must be as many velocities as heights, or none");
  check_alignment(velocities.data(), sizeof(float));
  check_alignment(fresh.data(), sizeof(float)), check_alignment(given.data(), sizeof(float));
  map.velocities = velocities.data();
  finite(time, "the time");
  const auto [least, most] = intervals;
  std::ptrdiff_t start = 0;
  const StepLock lock;
  for (const Region& place : rectangles_of(rectangles, map, fresh.size())) {
    take_heights(map, place, {fresh.data() + start, given.size() == 0 ? nullptr : given.data() + start, time},
                 {least, most});
    start += place.size();
  }
}

// Writes a new estimate (h, w) to the rectangle whose first sample is `first`, as `take_corrected`.
void correct(Heights heights, Heights offsets, Clocks clocks, Pair first, Floats2 known, double time, double shown,
             double settle) {
  MapArrays map = map_of(heights, clocks);
  const auto [row, column] = first;
  const auto high = static_cast<std::int64_t>(known.shape(0)), wide = static_cast<std::int64_t>(known.shape(1));
  check_table(offsets, heights.shape(0), heights.shape(1), "offsets");
  if (row < 0 || column < 0 || high < 1 || wide < 1 || high > map.rows - row || wide > map.columns - column)
    throw std::invalid_argument("the estimate is empty or leaves the map");
  if (std::isnan(shown) || !(settle > 0.0)) throw std::invalid_argument("shown must be a time, and settle above zero");
  check_alignment(known.data(), sizeof(float));
  const Region place = {row, column, row + high, column + wide};
  check_clocks(map, place);
  map.offsets = offsets.data();
  const StepLock lock;
  take_corrected(map, place, {known.data(), finite(time, "the time"), shown, settle});
}

// Fuses the rectangle whose first sample is `first` with heights `measured` (h, w). `noises`: their variances (h, w), or
// (1, 1) = the same for all.
void fuse_at(Heights heights, Heights variances, Pair first, Floats2 measured, Floats2 noises, float grown,
             float gate_squared) {
  const std::size_t high = measured.shape(0), wide = measured.shape(1);
  const auto [row, column] = first;
  const bool same = noises.size() == 1;
  check_table(variances, heights.shape(0), heights.shape(1), "variances");
  if (!same && (noises.shape(0) != high || noises.shape(1) != wide))
    throw std::invalid_argument("noises must have the shape of the measured heights, or (1, 1)");
  if (row < 0 || column < 0 || high > heights.shape(0) || wide > heights.shape(1) ||
      static_cast<std::size_t>(row) > heights.shape(0) - high ||
      static_cast<std::size_t>(column) > heights.shape(1) - wide)
    throw std::invalid_argument("the measured heights leave the map");
  check_alignment(heights.data(), sizeof(float));
  check_alignment(measured.data(), sizeof(float)), check_alignment(noises.data(), sizeof(float));
  const std::vector<float> all(same ? wide : 0, same ? noises.data()[0] : 0.0f);
  for (std::size_t r = 0; r < high; ++r) {
    const std::size_t at = (static_cast<std::size_t>(row) + r) * heights.shape(1) + static_cast<std::size_t>(column);
    fuse(heights.data() + at, variances.data() + at, measured.data() + r * wide,
         same ? all.data() : noises.data() + r * wide, wide, {grown, gate_squared});
  }
}

// Notes an update in a mesh's clock (1, ...); returns the `inverse` and `keep` of VelocityUpdate.
std::tuple<double, double> note_update_of(Array<std::uint8_t, 2> clock, double time, bool given, bool whole,
                                          std::tuple<double, double> intervals) {
  if (clock.shape(0) != 1 || clock.shape(1) != sizeof(Clock))
    throw std::invalid_argument("the clock must be one record of CLOCK");
  Clock* noted = clocks_at(clock.data());
  check_clock(*noted);
  const VelocityUpdate update = note_update(*noted, finite(time, "the time"), given, whole,
                                            {std::get<0>(intervals), std::get<1>(intervals)});
  return {update.inverse, update.keep};
}

using Cells = Array<std::int64_t, 3>;
using LastHeights = Array<double, 3>;
using Steps = Array<double, 2>;

Lattice lattice_of(const Cells& cells, const LastHeights& heights, const Steps& steps, const Pair& stride) {
  const auto [down, along] = stride;
  const std::size_t high = steps.shape(0), wide = steps.shape(1);
  if (high < 1 || wide < 1 || cells.shape(0) != high || cells.shape(1) != wide || cells.shape(2) != 2)
    throw std::invalid_argument("cells must have the shape (n, m, 2), steps (n, m)");
  if (heights.shape(0) != high || heights.shape(1) != wide || heights.shape(2) != STENCIL)
    throw std::invalid_argument("the heights of a lattice must have the shape (n, m, 3)");
  if (down < 1 || along < 1 || down > static_cast<std::int64_t>(MOST_SIDE) || along > static_cast<std::int64_t>(MOST_SIDE))
    throw std::invalid_argument("lattice points are 1 to 2^24 samples apart");
  check_alignment(cells.data(), sizeof(std::int64_t));
  check_alignment(heights.data(), sizeof(double)), check_alignment(steps.data(), sizeof(double));
  return {cells.data(), heights.data(), steps.data(), static_cast<std::int64_t>(high), static_cast<std::int64_t>(wide),
          down, along};
}

PlacedMap placed(const Floats2& heights, double z, const Pair& first) {
  const auto [row, column] = first;
  const auto is_near = [](std::int64_t k) { return k >= -FARTHEST_SAMPLE && k <= FARTHEST_SAMPLE; };
  if (!is_near(row) || !is_near(column) || heights.shape(0) > MOST_SIDE || heights.shape(1) > MOST_SIDE)
    throw std::invalid_argument("a map is too large or too far away");
  check_alignment(heights.data(), sizeof(float));
  return {heights.data(), static_cast<std::int64_t>(heights.shape(0)), static_cast<std::int64_t>(heights.shape(1)), z,
          row, column};
}

nb::tuple compare_maps(Cells cells, LastHeights last, Steps steps, Pair stride, Floats2 heights, double z, Pair first,
                       double least) {
  const LatticeCounts n = compare(lattice_of(cells, last, steps, stride), placed(heights, z, first), least);
  return nb::make_tuple(nb::make_tuple(n.known, n.changed, n.reversed, n.tilted, n.agreeing, n.tilt), n.median);
}

bool map_moved_as_one(Cells cells, LastHeights last, Steps steps, Pair stride, Floats2 heights, double z, Pair first,
                      double least) {
  return moved_as_one(lattice_of(cells, last, steps, stride), placed(heights, z, first), least);
}

}  // namespace

void add_updates(nb::module_& m) {
  m.def("take_rectangles", &take_rectangles, "heights"_a.noconvert(), "velocities"_a.noconvert(), "clocks"_a.noconvert(),
        "rectangles"_a.noconvert(), "fresh"_a.noconvert(), "given"_a.noconvert(), "time"_a, "intervals"_a);
  m.def("take_corrected", &correct, "heights"_a.noconvert(), "offsets"_a.noconvert(), "clocks"_a.noconvert(), "first"_a,
        "known"_a.noconvert(), "time"_a, "shown"_a, "settle"_a);
  m.def("fuse", &fuse_at, "heights"_a.noconvert(), "variances"_a.noconvert(), "first"_a, "measured"_a.noconvert(),
        "noises"_a.noconvert(), "grown"_a, "gate_squared"_a);
  m.def("note_update", &note_update_of, "clock"_a.noconvert(), "time"_a, "given"_a, "whole"_a, "intervals"_a);
  m.def("compare_maps", &compare_maps, "cells"_a.noconvert(), "last"_a.noconvert(), "steps"_a.noconvert(), "stride"_a,
        "heights"_a.noconvert(), "z"_a, "first"_a, "least"_a);
  m.def("moved_as_one", &map_moved_as_one, "cells"_a.noconvert(), "last"_a.noconvert(), "steps"_a.noconvert(),
        "stride"_a, "heights"_a.noconvert(), "z"_a, "first"_a, "least"_a);
}

}  // namespace smartmesh
