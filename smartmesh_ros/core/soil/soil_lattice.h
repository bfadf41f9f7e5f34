// Soil of a height map at a finer spacing than the map's, kept where bodies have been.
//
// A wheel's contact is shorter than a few samples of a usual map: its load would jump by a third whenever it leaves a
// sample.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <set>
#include <unordered_map>
#include <vector>

#include "map/window.h"
#include "soil/soil_law.h"

namespace smartmesh {

// Soil of a fine sample. `level` [m]: height of the ground as it was never pressed, without the map's z; NaN = hole.
// `pressure` [Pa]: at the end of the step `step`, the last one in which a body was there, 0 = never looked at.
struct FineSample {
  double level = 0.0;
  Yield yield{0.0, 0.0};
  float pressure = 0.0f;
  std::int32_t step = 0;
};

using Soils = std::vector<SoilType>;  // of a map, at least one

// A sample of the map, and its height after bodies pressed the soil there, without the map's z [m].
struct PressedNode {
  int row, column;
  float height;
};

// All that a soil knows of the past: fine samples by `places`, their index in rows, and the map's samples where bodies
// have been (`nodes`) with their heights [m], or that were pressed since `take_pressed`.
struct SoilMemory {
  std::vector<std::int64_t> places, nodes, pressed;
  std::vector<FineSample> samples;
  std::vector<float> heights;
};

class SoilLattice {
 public:
  // `spacing` [m]: largest of the fine samples.
  SoilLattice(const HeightGrid& map, const Soils& soils, double spacing);

  bool sinks_by_slip = true;  // wheels that slip dig themselves in

  const HeightGrid& map() const { return map_; }
  double spacing() const { return map_.resolution / refine_; }
  int rows() const { return (map_.rows - 1) * refine_ + 1; }
  int columns() const { return (map_.columns - 1) * refine_ + 1; }
  int kind(int row, int column) const { return std::min<int>(kinds_[nearest(row, column)], soil_count() - 1); }
  int soil_count() const { return static_cast<int>(soils_.size()); }
  const SoilType& soil(int kind) const { return soils_[kind]; }
  // Takes which soil each sample of the map is. Soil of another kind keeps its sinkage, but has borne nothing yet.
  void set_kinds(const std::uint8_t* kinds);

  // Takes the ground of some fine samples for new soil where others changed the map. What is under a body since the
  // `last` step keeps its sinkage: it moves with the ground.
  void renew(const CellRange& samples, std::int32_t last);
  // Returns the highest of the map's samples around these, without the map's z [m]; -1e300 = holes alone.
  double highest(const CellRange& samples) const;
  // Returns the normal of the ground as it was never pressed, between distances along columns `x` and rows `y` [m] on
  // both sides of a place, in axes of the grid, upwards; of steps that of the steepest slope. Holes, and what is beside
  // the map, count as level.
  Vec3 normal_around(const GridPoint& at, double x, double y) const;
  // Returns how far a fine sample is pressed below the map, which shows the means around its samples, and later [m].
  // `last`: as in `renew`, of loads that still press it.
  double below_map(int row, int column, std::int32_t last) const;
  // Returns a fine sample; `renew` it before.
  FineSample& at(int row, int column);
  // Notes that a body pressed a sample.
  void note(int row, int column);
  // Returns the samples of the map that bodies pressed since the last call. The map must have these heights before the
  // next step.
  std::vector<PressedNode> take_pressed();
  // Writes how far the ground of each sample of the map was pressed, where bodies have been [m].
  void read_sinkage(double* sinkage) const;
  void reset();

  // Returns what it knows, in order, and takes it over; the places must be those of its own samples.
  SoilMemory memory() const;
  void recall(const SoilMemory& memory);

 private:
  static constexpr int SIDE_SHIFT = 4, SIDE = 1 << SIDE_SHIFT;
  using Block = std::array<FineSample, SIDE * SIDE>;

  std::int64_t node_index(int row, int column) const { return static_cast<std::int64_t>(row) * map_.columns + column; }
  float mapped(int row, int column) const { return map_.heights[map_.index(row, column)]; }
  double level_at(int row, int column) const;
  // Returns the level at the fine sample that is nearest, NaN beside the map.
  double unpressed_at(double row, double column) const;
  // Returns true if the map around a fine sample has the heights that the soil gave it or found there.
  bool is_known_around(int row, int column) const;
  // Returns the index of the map's sample that is nearest to a fine one.
  std::size_t nearest(int row, int column) const;
  // Returns true if the sample stays pressed.
  bool renew(int row, int column, std::int32_t last);
  // Returns a fine sample, null if it was never looked at.
  const FineSample* find(int row, int column) const;
  // Returns the samples of the map around some fine ones.
  CellRange mapped_around(const CellRange& samples) const;
  // Returns the fine samples around a sample of the map.
  CellRange around(int node_row, int node_column) const;
  // Returns the mean sinkage around a sample of the map [m].
  double mean_around(int node_row, int node_column) const;

  const HeightGrid& map_;
  Soils soils_;
  std::vector<std::uint8_t> kinds_;  // of the samples of the map
  int refine_, block_columns_;
  std::vector<std::unique_ptr<Block>> blocks_;
  std::unordered_map<std::int64_t, float> known_;  // heights of the map where bodies have been [m]
  std::set<std::int64_t> pressed_;                 // samples of the map since `take_pressed`
};

}  // namespace smartmesh
