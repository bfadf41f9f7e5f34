#include "map/sample_lattice.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace smartmesh {

namespace {

constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
// Largest row or column of a lattice point that is used; larger ones overflow.
constexpr std::int64_t FARTHEST = std::int64_t{1} << 38;

std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return a / b + (a % b > 0); }
std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0); }
std::int64_t modulo(std::int64_t a, std::int64_t b) { return a - b * floor_div(a, b); }

// Returns the change of a stored height to a new one [m], and stores the new one.
double change_to(double& last, double height) {
  const double change = height - last;
  last = height;
  return change;
}

// Moves a place of the ring buffer to the lattice point (i, j), about which nothing is known yet.
void move_to(const Lattice& lattice, std::int64_t place, std::int64_t i, std::int64_t j) {
  std::int64_t* cell = lattice.cells + 2 * place;
  if (cell[0] == i && cell[1] == j) return;
  cell[0] = i, cell[1] = j;
  std::fill_n(lattice.heights + STENCIL * place, STENCIL, NONE);
  lattice.steps[place] = 0.0;
}

// Counts one lattice point by the changes of its sample and of its neighbours.
void count(double left, double step, double right, double& last_step, double least, LatticeCounts& counts) {
  if (std::abs(step) >= least) {
    counts.changed += last_step != 0.0;
    counts.reversed += step * last_step < 0.0;
    last_step = step;
  }
  if (std::abs(step - left) >= least && std::abs(right - step) >= least) {
    ++counts.tilted;
    counts.agreeing += (step - left) * (right - step) > 0.0;
    counts.tilt += std::abs(step - left);
  }
}

// Returns the median as NumPy does.
double median_of(std::vector<double>& sizes) {
  if (sizes.empty()) return 0.0;
  const std::size_t half = sizes.size() / 2;
  std::sort(sizes.begin(), sizes.end());
  return sizes.size() % 2 == 1 ? sizes[half] : (sizes[half - 1] + sizes[half]) / 2.0;
}

}  // namespace

double PlacedMap::at(std::int64_t row, std::int64_t column) const {
  if (row < 0 || column < 0 || row >= rows || column >= columns) return NONE;
  return z + static_cast<double>(heights[row * columns + column]);
}

LatticeCounts compare(const Lattice& lattice, const PlacedMap& map, double least) {
  LatticeCounts counts;
  std::vector<double> sizes;
  const std::int64_t last_i = floor_div(map.first_row + map.rows - 1, lattice.down);
  const std::int64_t last_j = floor_div(map.first_column + map.columns - 1, lattice.along);
  for (std::int64_t i = ceil_div(map.first_row, lattice.down); i <= last_i; ++i) {
    for (std::int64_t j = ceil_div(map.first_column, lattice.along); j <= last_j; ++j) {
      const std::int64_t row = i * lattice.down - map.first_row, column = j * lattice.along - map.first_column;
      const std::int64_t place = modulo(i, lattice.high) * lattice.wide + modulo(j, lattice.wide);
      move_to(lattice, place, i, j);
      double* last = lattice.heights + STENCIL * place;
      const double left = change_to(last[0], map.at(row, column - 1)), step = change_to(last[1], map.at(row, column)),
                   right = change_to(last[2], map.at(row, column + 1));
      if (!std::isnan(step)) sizes.push_back(std::abs(step));
      count(left, step, right, lattice.steps[place], least, counts);
    }
  }
  counts.known = static_cast<std::int64_t>(sizes.size());
  counts.median = median_of(sizes);
  return counts;
}

bool moved_as_one(const Lattice& lattice, const PlacedMap& map, double least) {
  bool known = false;
  double rise = 0.0;
  for (std::int64_t place = 0; place < lattice.high * lattice.wide; ++place) {
    const std::int64_t i = lattice.cells[2 * place], j = lattice.cells[2 * place + 1];
    if (i < -FARTHEST || i > FARTHEST || j < -FARTHEST || j > FARTHEST) continue;
    const double height = map.at(i * lattice.down - map.first_row, j * lattice.along - map.first_column);
    const double change = height - lattice.heights[STENCIL * place + 1];
    if (std::isnan(change)) continue;
    if (!known) rise = change;
    if (std::abs(change - rise) > least) return false;
    known = true;
  }
  return known;
}

}  // namespace smartmesh
