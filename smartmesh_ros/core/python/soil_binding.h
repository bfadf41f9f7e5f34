// Soil as Python makes it.
#pragma once

#include <cmath>

#include "bullet/soil_in_step.h"
#include "python/tables.h"
#include "step/step_lock.h"

namespace smartmesh {

// Soil of a map for the steps of a world; the arrays stay alive with it.
struct Soil {
  static constexpr double MOST_STEPS = 2147483647.0;  // that a sample counts

  nb::object grid;
  Doubles2 soils;
  SoilInStep soil;

  Soil(nb::object of, Bytes2 kinds, Doubles2 soils_s, double spacing)
      : grid(of),
        soils(soils_s),
        soil(checked(of, soils_s, spacing),
             {reinterpret_cast<const SoilType*>(soils_s.data()), static_cast<int>(soils_s.shape(0))}, spacing) {
    set_kinds(kinds);
  }

  Soil(const Soil&) = delete;

  static const HeightGrid& checked(nb::handle of, const Doubles2& soils, double spacing) {
    const HeightGrid& map = nb::cast<Grid&>(of).grid;
    if (soils.shape(0) < 1 || soils.shape(0) > 255 || soils.shape(1) * sizeof(double) != sizeof(SoilType))
      throw std::invalid_argument("soils must have the shape (S, 8), with 1 to 255 soils");
    check_alignment(soils.data(), sizeof(double));
    if (!(spacing > 0.0 && map.resolution / spacing < 1000.0))
      throw std::invalid_argument("the spacing is out of its range");
    return map;
  }
  // Takes which soil each sample of the map is (rows, columns).
  void set_kinds(Bytes2 kinds) {
    const HeightGrid& map = soil.lattice.map();
    check_table(kinds, static_cast<std::size_t>(map.rows), static_cast<std::size_t>(map.columns), "kinds");
    const StepLock lock;
    soil.lattice.set_kinds(kinds.data());
  }
  // Returns the rows and columns (n, 2), and the heights (n,) of the samples of the map that were pressed.
  auto take_pressed() {
    std::vector<std::int64_t> places;
    std::vector<float> heights;
    {
      const StepLock lock;
      for (const PressedNode& node : soil.lattice.take_pressed())
        places.insert(places.end(), {node.row, node.column}), heights.push_back(node.height);
    }
    const std::size_t count = heights.size();
    return std::make_tuple(array_of<std::int64_t, 2>(places, {count, 2}), array_of<float, 1>(heights, {count}));
  }
  // Returns what it knows of the past: places (n,) and samples (n, 5) of SoilMemory, nodes (k,), their heights (k,),
  // pressed nodes (p,), and the number of the next step.
  auto memory() const {
    SoilMemory found;
    {
      const StepLock lock;
      found = soil.lattice.memory();
    }
    const std::size_t count = found.places.size();
    std::vector<double> samples;
    for (const FineSample& it : found.samples)
      samples.insert(samples.end(),
                     {it.level, it.yield.plastic, it.yield.yielded, it.pressure, static_cast<double>(it.step)});
    return std::make_tuple(array_of<std::int64_t, 1>(found.places, {count}), array_of<double, 2>(samples, {count, 5}),
                           array_of<std::int64_t, 1>(found.nodes, {found.nodes.size()}),
                           array_of<float, 1>(found.heights, {found.heights.size()}),
                           array_of<std::int64_t, 1>(found.pressed, {found.pressed.size()}), soil.step());
  }
  // Takes over what `memory` returned.
  void recall(Slots places, Doubles2 samples, Slots nodes, Array<const float, 1> heights, Slots pressed,
              std::int32_t step) {
    const SoilLattice& lattice = soil.lattice;
    check_table(samples, places.shape(0), 5, "samples"), check_list(heights, nodes.shape(0), "heights");
    SoilMemory memory;
    memory.places =
        slots_below(places, static_cast<std::size_t>(lattice.rows()) * static_cast<std::size_t>(lattice.columns()));
    const std::size_t size =
        static_cast<std::size_t>(lattice.map().rows) * static_cast<std::size_t>(lattice.map().columns);
    memory.nodes = slots_below(nodes, size), memory.pressed = slots_below(pressed, size);
    memory.heights.assign(heights.data(), heights.data() + heights.shape(0));
    for (std::size_t k = 0; k < places.shape(0); ++k) {
      const double* it = samples.data() + 5 * k;
      if (!(std::abs(it[4]) <= MOST_STEPS)) throw std::invalid_argument("the step of a sample is out of its range");
      memory.samples.push_back({it[0], {it[1], it[2]}, static_cast<float>(it[3]), static_cast<std::int32_t>(it[4])});
    }
    if (step < 2) throw std::invalid_argument("the step of a soil is out of its range");
    const StepLock lock;
    soil.lattice.recall(memory);
    soil.go_on_from(step);
  }
  // Writes how far the ground of each sample of the map was pressed (rows, columns) [m].
  void sinkage(States found) {
    const HeightGrid& map = soil.lattice.map();
    check_table(found, static_cast<std::size_t>(map.rows), static_cast<std::size_t>(map.columns), "sinkage");
    const StepLock lock;
    soil.lattice.read_sinkage(found.data());
  }
};

}  // namespace smartmesh
