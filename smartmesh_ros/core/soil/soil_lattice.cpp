#include "soil/soil_lattice.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Steepest slope of soil, of 35 degrees; what is steeper is a step.
constexpr double STEEPEST = 0.7;

}  // namespace

SoilLattice::SoilLattice(const HeightGrid& map, const Soils& soils, double spacing)
    : map_(map),
      soils_(soils),
      refine_(std::max(1, static_cast<int>(std::ceil(map.resolution / spacing - 1e-9)))),
      block_columns_((columns() >> SIDE_SHIFT) + 1) {
  reset();
}

void SoilLattice::reset() {
  blocks_.clear();
  blocks_.resize(static_cast<std::size_t>((rows() >> SIDE_SHIFT) + 1) * block_columns_);
  known_.clear();
  pressed_.clear();
}

SoilMemory SoilLattice::memory() const {
  SoilMemory found;
  for (std::size_t k = 0; k < blocks_.size(); ++k) {
    const std::int64_t top = static_cast<std::int64_t>(k / block_columns_) << SIDE_SHIFT, left = (k % block_columns_)
                                                                                                 << SIDE_SHIFT;
    for (int i = 0; blocks_[k] != nullptr && i < SIDE * SIDE; ++i) {
      if ((*blocks_[k])[i].step == 0) continue;
      found.places.push_back((top + i / SIDE) * columns() + left + i % SIDE);
      found.samples.push_back((*blocks_[k])[i]);
    }
  }
  for (const auto& [node, height] : known_) found.nodes.push_back(node);
  std::sort(found.nodes.begin(), found.nodes.end());
  for (const std::int64_t node : found.nodes) found.heights.push_back(known_.at(node));
  found.pressed.assign(pressed_.begin(), pressed_.end());
  return found;
}

void SoilLattice::recall(const SoilMemory& memory) {
  reset();
  for (std::size_t k = 0; k < memory.places.size(); ++k)
    at(static_cast<int>(memory.places[k] / columns()), static_cast<int>(memory.places[k] % columns())) =
        memory.samples[k];
  for (std::size_t k = 0; k < memory.nodes.size(); ++k) known_[memory.nodes[k]] = memory.heights[k];
  pressed_.insert(memory.pressed.begin(), memory.pressed.end());
}

std::size_t SoilLattice::nearest(int row, int column) const {
  const int r = (row + refine_ / 2) / refine_, c = (column + refine_ / 2) / refine_;
  return map_.index(std::min(r, map_.rows - 1), std::min(c, map_.columns - 1));
}

void SoilLattice::set_kinds(const std::uint8_t* kinds) {
  for (std::size_t k = 0; !kinds_.empty() && k < blocks_.size(); ++k) {
    if (blocks_[k] == nullptr) continue;
    const int top = static_cast<int>(k / block_columns_) << SIDE_SHIFT, left = static_cast<int>(k % block_columns_)
                                                                               << SIDE_SHIFT;
    for (int i = 0; i < SIDE * SIDE; ++i) {
      const std::size_t at = nearest(top + i / SIDE, left + i % SIDE);
      if (kinds_[at] != kinds[at]) (*blocks_[k])[i].yield.yielded = 0.0;
    }
  }
  kinds_.assign(kinds, kinds + static_cast<std::size_t>(map_.rows) * static_cast<std::size_t>(map_.columns));
}

double SoilLattice::level_at(int row, int column) const {
  const int r = std::min(row / refine_, map_.rows - 2), c = std::min(column / refine_, map_.columns - 2);
  const double v = static_cast<double>(row - r * refine_) / refine_,
               u = static_cast<double>(column - c * refine_) / refine_;
  // A place on a sample must not see a hole beside it.
  const auto part = [](double weight, float height) { return weight > 0.0 ? weight * height : 0.0; };
  return part((1.0 - v) * (1.0 - u), mapped(r, c)) + part((1.0 - v) * u, mapped(r, c + 1)) +
         part(v * (1.0 - u), mapped(r + 1, c)) + part(v * u, mapped(r + 1, c + 1));
}

CellRange SoilLattice::mapped_around(const CellRange& samples) const {
  return {samples.top / refine_, samples.left / refine_, std::min((samples.bottom - 1) / refine_ + 2, map_.rows),
          std::min((samples.right - 1) / refine_ + 2, map_.columns)};
}

double SoilLattice::highest(const CellRange& samples) const {
  const auto [top, left, bottom, right] = mapped_around(samples);
  double found = -1e300;
  for (int r = top; r < bottom; ++r)
    for (int c = left; c < right; ++c)
      if (mapped(r, c) > found) found = mapped(r, c);  // not NaN
  return found;
}

double SoilLattice::unpressed_at(double row, double column) const {
  if (!(row >= 0.0 && column >= 0.0 && row <= rows() - 1 && column <= columns() - 1)) return NONE;
  const int r = static_cast<int>(std::lround(row)), c = static_cast<int>(std::lround(column));
  const FineSample* sample = find(r, c);
  return sample != nullptr ? sample->level : level_at(r, c);
}

Vec3 SoilLattice::normal_around(const GridPoint& at, double x, double y) const {
  const auto slope = [&](double rows, double columns) {
    const double rise =
        unpressed_at(at.row + rows, at.column + columns) - unpressed_at(at.row - rows, at.column - columns);
    return std::isnan(rise) ? 0.0 : rise / (2.0 * (rows + columns) * spacing());
  };
  Vec3 normal{-slope(0.0, x / spacing()), -slope(y / spacing(), 0.0), 1.0};
  const double steepness = std::hypot(normal.x, normal.y);
  if (steepness > STEEPEST) normal.x *= STEEPEST / steepness, normal.y *= STEEPEST / steepness;
  return unit(normal);
}

FineSample& SoilLattice::at(int row, int column) {
  auto& block = blocks_[static_cast<std::size_t>(row >> SIDE_SHIFT) * block_columns_ + (column >> SIDE_SHIFT)];
  if (block == nullptr) block = std::make_unique<Block>();
  FineSample& sample = (*block)[(row & (SIDE - 1)) * SIDE + (column & (SIDE - 1))];
  if (sample.step == 0) sample = {level_at(row, column), {0.0, 0.0}, 0.0f, -1};
  return sample;
}

bool SoilLattice::renew(int row, int column, std::int32_t last) {
  FineSample& sample = at(row, column);
  sample.level = level_at(row, column);
  if (sample.step < last) sample.yield = {0.0, 0.0}, sample.step = -1;
  return sample.yield.plastic > 0.0;
}

void SoilLattice::renew(const CellRange& samples, std::int32_t last) {
  const auto [top, left, bottom, right] = mapped_around(samples);
  for (int r = top; r < bottom; ++r) {
    for (int c = left; c < right; ++c) {
      const float height = mapped(r, c);
      const auto [known, is_new] = known_.try_emplace(node_index(r, c), height);
      if (is_new || known->second == height || (std::isnan(known->second) && std::isnan(height))) continue;
      known->second = height;
      bool is_pressed = false;
      for (int i = std::max(0, (r - 1) * refine_ + 1); i < std::min((r + 1) * refine_, rows()); ++i)
        for (int k = std::max(0, (c - 1) * refine_ + 1); k < std::min((c + 1) * refine_, columns()); ++k)
          is_pressed |= renew(i, k, last);
      if (is_pressed) pressed_.insert(node_index(r, c));
    }
  }
}

void SoilLattice::note(int row, int column) {
  // A sample in the middle between two samples of the map is around both.
  const int half = refine_ / 2, before = refine_ - 1 - half;
  for (int r = (row + before) / refine_; r <= (row + half) / refine_; ++r)
    for (int c = (column + before) / refine_; c <= (column + half) / refine_; ++c) pressed_.insert(node_index(r, c));
}

const FineSample* SoilLattice::find(int row, int column) const {
  const auto& block = blocks_[static_cast<std::size_t>(row >> SIDE_SHIFT) * block_columns_ + (column >> SIDE_SHIFT)];
  const FineSample* sample = block ? &(*block)[(row & (SIDE - 1)) * SIDE + (column & (SIDE - 1))] : nullptr;
  return sample != nullptr && sample->step != 0 ? sample : nullptr;
}

bool SoilLattice::is_known_around(int row, int column) const {
  const auto [top, left, bottom, right] = mapped_around({row, column, row + 1, column + 1});
  for (int r = top; r < bottom; ++r) {
    for (int c = left; c < right; ++c) {
      const auto known = known_.find(node_index(r, c));
      if (known == known_.end() || known->second != mapped(r, c)) return false;
    }
  }
  return true;
}

double SoilLattice::below_map(int row, int column, std::int32_t last) const {
  const FineSample* sample = find(row, column);
  if (sample == nullptr) return 0.0;
  const bool is_loaded = sample->step >= last;
  const double elastic = is_loaded ? sample->pressure / soil(kind(row, column)).elastic : 0.0;
  const double pressed = sample->yield.plastic + elastic;
  if (is_known_around(row, column)) return level_at(row, column) - sample->level + pressed;
  return is_loaded ? pressed : 0.0;  // as `renew` will have it
}

CellRange SoilLattice::around(int node_row, int node_column) const {
  const int half = refine_ / 2, row = node_row * refine_, column = node_column * refine_;
  return {std::max(0, row - half), std::max(0, column - half), std::min(row + half + 1, rows()),
          std::min(column + half + 1, columns())};
}

double SoilLattice::mean_around(int node_row, int node_column) const {
  const auto [top, left, bottom, right] = around(node_row, node_column);
  double sunk = 0.0;
  int count = 0;
  for (int r = top; r < bottom; ++r) {
    for (int c = left; c < right; ++c) {
      const FineSample* sample = find(r, c);
      if (std::isnan(sample != nullptr ? sample->level : level_at(r, c))) continue;
      if (sample != nullptr) sunk += sample->yield.plastic;
      ++count;
    }
  }
  return count > 0 ? sunk / count : 0.0;
}

void SoilLattice::read_sinkage(double* sinkage) const {
  for (const auto& [node, height] : known_)
    sinkage[node] = mean_around(static_cast<int>(node / map_.columns), static_cast<int>(node % map_.columns));
}

std::vector<PressedNode> SoilLattice::take_pressed() {
  std::vector<PressedNode> found;
  std::set<std::int64_t> later;  // where others changed the map: `renew` has not yet moved the soil
  for (const std::int64_t node : pressed_) {
    const int row = static_cast<int>(node / map_.columns), column = static_cast<int>(node % map_.columns);
    // The levels of all samples around are those of the map before it changes.
    const auto [top, left, bottom, right] = around(row, column);
    for (int r = top; r < bottom; ++r)
      for (int c = left; c < right; ++c) at(r, c);
    const double level = at(row * refine_, column * refine_).level;
    const float height = static_cast<float>(level - mean_around(row, column));
    float& known = known_[node];
    if (std::isnan(height) || known == height) continue;
    if (known != mapped(row, column)) {
      later.insert(node);
      continue;
    }
    known = height;
    found.push_back({row, column, height});
  }
  pressed_.swap(later);
  return found;
}

}  // namespace smartmesh
