#include "map_prints.h"

#include <cmath>
#include <limits>

#include "height_grid.h"

namespace smartmesh {

namespace {

// Calls `use(index)` for the pressed samples of a map.
template <class Use>
void each_pressed(const HeightGrid& map, const std::vector<float>& given, const Region& around, const Use& use) {
  for (std::ptrdiff_t row = around.top; row < around.bottom; ++row) {
    for (std::ptrdiff_t column = around.left; column < around.right; ++column) {
      const std::size_t i = map.index(static_cast<int>(row), static_cast<int>(column));
      if (!std::isnan(given[i])) use(i);
    }
  }
}

}  // namespace

void Prints::press(HeightGrid& map, int row, int column, float height) {
  if (given_.empty()) given_.assign(map.samples(), std::numeric_limits<float>::quiet_NaN());
  const std::size_t i = map.index(row, column);
  if (std::isnan(given_[i])) given_[i] = map.heights[i];
  map.heights[i] = height;
  around_ = around_.size() == 0 ? Region{row, column, row + 1, column + 1} : around_.with(row, column);
}

void Prints::lift(HeightGrid& map) {
  lifted_.clear();
  each_pressed(map, given_, around_, [&](std::size_t i) {
    lifted_.push_back(map.heights[i]);
    map.heights[i] = given_[i];
  });
}

void Prints::put_back(HeightGrid& map) {
  auto print = lifted_.begin();
  each_pressed(map, given_, around_, [&](std::size_t i) {
    if (map.heights[i] == given_[i]) map.heights[i] = *print;
    else given_[i] = std::numeric_limits<float>::quiet_NaN();
    ++print;
  });
}

}  // namespace smartmesh
