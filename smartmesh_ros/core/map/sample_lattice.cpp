#include "map/sample_lattice.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

std::int64_t ceil_div(std::int64_t a, std::int64_t b) { return a / b + (a % b > 0); }
std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0); }
std::int64_t modulo(std::int64_t a, std::int64_t b) { return a - b * floor_div(a, b); }

// Returns the change of a stored height to a new one [m], and stores the new one.
double change_to(double& last, double height) {
  const double change = height - last;
  last = height;
  return change;
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

SampleLattice::SampleLattice(std::int64_t rows, std::int64_t columns, std::int64_t points)
    : down_(std::max<std::int64_t>(ceil_div(rows, points), 1)),
      along_(std::max<std::int64_t>(ceil_div(columns, points), 1)),
      high_(ceil_div(rows, down_) + 1),  // one more if the map is not aligned
      wide_(ceil_div(columns, along_) + 1),
      points_(static_cast<std::size_t>(high_ * wide_)) {}

LatticeCounts SampleLattice::compare(const PlacedMap& map, double least) {
  LatticeCounts counts;
  std::vector<double> sizes;
  const std::int64_t last_i = floor_div(map.first_row + map.rows - 1, down_);
  const std::int64_t last_j = floor_div(map.first_column + map.columns - 1, along_);
  for (std::int64_t i = ceil_div(map.first_row, down_); i <= last_i; ++i) {
    for (std::int64_t j = ceil_div(map.first_column, along_); j <= last_j; ++j) {
      const std::int64_t row = i * down_ - map.first_row, column = j * along_ - map.first_column;
      Point& point = points_[modulo(i, high_) * wide_ + modulo(j, wide_)];
      if (point.i != i || point.j != j) point = {i, j};
      const double left = change_to(point.left, map.at(row, column - 1)),
                   step = change_to(point.own, map.at(row, column)),
                   right = change_to(point.right, map.at(row, column + 1));
      if (!std::isnan(step)) sizes.push_back(std::abs(step));
      count(left, step, right, point.step, least, counts);
    }
  }
  counts.known = static_cast<std::int64_t>(sizes.size());
  counts.median = median_of(sizes);
  return counts;
}

bool SampleLattice::moved_as_one(const PlacedMap& map, double least) const {
  bool known = false;
  double rise = 0.0;
  for (const Point& point : points_) {
    const double height = map.at(point.i * down_ - map.first_row, point.j * along_ - map.first_column);
    const double change = height - point.own;
    if (std::isnan(change)) continue;
    if (!known) rise = change;
    if (std::abs(change - rise) > least) return false;
    known = true;
  }
  return known;
}

void SampleLattice::forget() {
  for (Point& point : points_) point = {point.i, point.j};
}

}  // namespace smartmesh
