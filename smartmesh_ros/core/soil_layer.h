// State of the soil under each sample of a height map.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "height_grid.h"
#include "soil_law.h"

namespace smartmesh {

// Soil of a sample, with the layout of LAYER_SAMPLE in soil/layer.py, which explains the fields.
struct LayerSample {
  double level, target;
  float plastic, yielded, pressure, shear_x, shear_y, known;
  std::uint8_t touched, moves;
  std::int32_t pressed;
};
static_assert(sizeof(LayerSample) == 48, "the layout of LAYER_SAMPLE in soil/layer.py");

// Soil of a height map; the arrays belong to Python. `kinds`: place of each sample's soil in `soils`.
struct SoilLayer {
  LayerSample* samples = nullptr;
  const std::uint8_t* kinds = nullptr;
  const SoilType* soils = nullptr;
  int soil_count = 0, rows = 0, columns = 0;
};

// Rectangle of samples: first row and column, last row and column. NOWHERE to -1 = no samples.
constexpr std::int32_t NOWHERE = std::numeric_limits<std::int32_t>::max();
struct SampleRectangle {
  std::int32_t top = NOWHERE, left = NOWHERE, bottom = -1, right = -1;

  bool empty() const { return bottom < top || right < left; }
  void add(int row, int column) {
    top = std::min(top, row), left = std::min(left, column);
    bottom = std::max(bottom, row), right = std::max(right, column);
  }
  // Returns the rectangle with a margin around it, within a map.
  SampleRectangle grown(int margin, int rows, int columns) const {
    if (empty()) return {};
    return {std::max(top - margin, 0), std::max(left - margin, 0), std::min(bottom + margin, rows - 1),
            std::min(right + margin, columns - 1)};
  }
  SampleRectangle with(const SampleRectangle& other) const {
    return {std::min(top, other.top), std::min(left, other.left), std::max(bottom, other.bottom),
            std::max(right, other.right)};
  }
};

// A height map and its soil at one instant. All heights are without the grid's z.
class SoilGround {
 public:
  SoilGround(const HeightGrid& grid, const SoilLayer& layer, double time)
      : rows(grid.rows), columns(grid.columns), spacing(grid.resolution), z(grid.z), pose(grid.pose_at(time)),
        heights_(grid.heights), layer_(layer), reader_(grid, time, 0.0) {}

  const int rows, columns;
  const double spacing, z;
  const GridPose pose;

  LayerSample& at(int row, int column) { return layer_.samples[index(row, column)]; }
  // Returns the height in the map [m]; NaN = hole.
  float mapped(int row, int column) const { return heights_[index(row, column)]; }
  // Returns the heights of `count` samples of a row at the instant [m]; they hold until the next call.
  const double* now(int row, int column, int count) {
    now_.resize(static_cast<std::size_t>(count));
    reader_.read_row(row, column, count, now_.data());
    for (double& height : now_) height -= z;
    return now_.data();
  }
  // Returns the place of a sample's soil in the table of soils.
  int kind(int row, int column) const { return std::min<int>(layer_.kinds[index(row, column)], layer_.soil_count - 1); }
  int soil_count() const { return layer_.soil_count; }
  const SoilType& soil(int kind) const { return layer_.soils[kind]; }

  // Returns true if the layer holds the soil of a sample: others change the map, and it then is new soil.
  bool knows(int row, int column) {
    const LayerSample& sample = at(row, column);
    return sample.touched == 1 && sample.known == mapped(row, column);
  }
  // Takes a sample into the layer, unless it knows it.
  void note(int row, int column) {
    if (knows(row, column)) return;
    const float height = mapped(row, column);
    LayerSample& sample = at(row, column);
    const std::int32_t pressed = sample.pressed;
    sample = {height, height, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f, height, 1, 0, pressed};
  }

 private:
  std::size_t index(int row, int column) const { return static_cast<std::size_t>(row) * columns + column; }

  const float* heights_;
  SoilLayer layer_;
  GridReader reader_;
  std::vector<double> now_;
};

}  // namespace smartmesh
