// Taking maps: velocities are difference quotients, and what a rectangle leaves out is at rest.
#include "map/map_updates.h"

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
    return grid.velocities[(clock.newest * ROWS + row) * COLUMNS + column];
  }
};

std::vector<float> raised(double height) { return std::vector<float>(ROWS * COLUMNS, static_cast<float>(height)); }

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
