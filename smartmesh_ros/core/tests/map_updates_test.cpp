// Taking maps: velocities are difference quotients, and rectangles one after the other equal the whole map at once.
#include "map/map_updates.h"

#include <algorithm>
#include <vector>

#include <gtest/gtest.h>

#include "map/map_memory.h"

namespace smartmesh {
namespace {

constexpr int ROWS = 70, COLUMNS = 130;  // of more than one block in both directions
constexpr Intervals INTERVALS{1e-4, 1.0};

struct Map : MapMemory {
  Map() : MapMemory(ROWS, COLUMNS) {}
  void take(const Region& place, const std::vector<float>& fresh, double time) {
    take_heights(grid, place, {fresh.data(), nullptr, time}, INTERVALS);
  }
  float newest(int row, int column) const {
    const Clock& clock = clocks[(row >> BLOCK_SHIFT) * 3 + (column >> BLOCK_SHIFT)];
    return velocities[(clock.newest * ROWS + row) * COLUMNS + column];
  }
};

std::vector<float> raised(double height) { return std::vector<float>(ROWS * COLUMNS, static_cast<float>(height)); }

TEST(MapUpdates, VelocityIsTheDifferenceQuotient) {
  Map map;
  map.take({0, 0, ROWS, COLUMNS}, raised(0.0), 0.0);
  map.take({0, 0, ROWS, COLUMNS}, raised(0.05), 0.1);
  for (int row : {0, 63, 64, 69})
    for (int column : {0, 63, 64, 129}) EXPECT_FLOAT_EQ(map.newest(row, column), 0.5f);
}

TEST(MapUpdates, PartsOfOneInstantEqualTheWhole) {
  Map whole, parts;
  for (double time : {0.0, 0.1, 0.2}) {
    const std::vector<float> fresh = raised(time * time);
    whole.take({0, 0, ROWS, COLUMNS}, fresh, time);
    for (const Region& place : {Region{0, 0, 30, COLUMNS}, Region{30, 0, ROWS, 100}, Region{30, 100, ROWS, COLUMNS}})
      parts.take(place, fresh, time);
  }
  EXPECT_TRUE(std::equal(whole.heights.begin(), whole.heights.end(), parts.heights.begin()));
  for (int row = 0; row < ROWS; ++row)
    for (int column = 0; column < COLUMNS; ++column)
      EXPECT_FLOAT_EQ(whole.newest(row, column), parts.newest(row, column));
}

TEST(MapUpdates, WhatARegionLeavesOutIsAtRest) {
  Map map;
  map.take({0, 0, ROWS, COLUMNS}, raised(0.0), 0.0);
  map.take({10, 10, 20, 20}, std::vector<float>(100, 0.1f), 0.1);
  EXPECT_FLOAT_EQ(map.newest(15, 15), 1.0f);
  EXPECT_FLOAT_EQ(map.newest(40, 40), 0.0f);
  EXPECT_EQ(map.clocks[1].time, 0.0);  // of a block that the region does not touch
}

}  // namespace
}  // namespace smartmesh
