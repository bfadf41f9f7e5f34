// Soil as Python sees it, and what tests see of the undersides that press it.
#include <cmath>

#include "bullet/soil_in_step.h"
#include "python/bindings.h"
#include "shape/body_shape.h"
#include "soil/soil_shape.h"

namespace smartmesh {
namespace {

// Soil of a map for the steps of a world; the map stays alive with it.
struct Soil {
  using SampleNumbers = std::array<double, 5>;        // level, plastic, yielded, pressure, step
  static constexpr double MOST_STEPS = 2147483647.0;  // that a sample counts

  nb::object grid;
  SoilInStep soil;

  Soil(nb::object of, Bytes2 kinds, Rows<const SoilType> soils, double spacing)
      : grid(of), soil(checked(of, soils, spacing), {soils.begin(), soils.end()}, spacing) {
    set_kinds(kinds);
  }

  Soil(const Soil&) = delete;

  static const HeightGrid& checked(nb::handle of, const Rows<const SoilType>& soils, double spacing) {
    const HeightGrid& map = nb::cast<Grid&>(of).grid;
    if (soils.size() < 1 || soils.size() > 255) throw std::invalid_argument("there are 1 to 255 soils");
    if (!(spacing > 0.0 && map.resolution / spacing < 1000.0))
      throw std::invalid_argument("the spacing is out of its range");
    return map;
  }
  // Takes which soil each sample of the map is (rows, columns).
  void set_kinds(Bytes2 kinds) {
    const HeightGrid& map = soil.lattice.map();
    check_shape(kinds, static_cast<std::size_t>(map.rows), static_cast<std::size_t>(map.columns), "kinds");
    const StepLock lock;
    soil.lattice.set_kinds(kinds.data());
  }
  // Returns the rows and columns (n, 2), and the heights (n,) of the samples of the map that were pressed.
  auto take_pressed() {
    std::vector<std::array<std::int64_t, 2>> places;
    std::vector<float> heights;
    {
      const StepLock lock;
      for (const PressedNode& node : soil.lattice.take_pressed())
        places.push_back({node.row, node.column}), heights.push_back(node.height);
    }
    return std::make_tuple(array_of(std::move(places)), array_of(std::move(heights)));
  }
  // Returns what it knows of the past: places (n,) and samples (n, 5) of SoilMemory, nodes (k,), their heights (k,),
  // pressed nodes (p,), and the number of the next step.
  auto memory() const {
    SoilMemory found;
    {
      const StepLock lock;
      found = soil.lattice.memory();
    }
    std::vector<SampleNumbers> samples;
    for (const FineSample& it : found.samples)
      samples.push_back({it.level, it.yield.plastic, it.yield.yielded, it.pressure, static_cast<double>(it.step)});
    return std::make_tuple(array_of(found.places), array_of(std::move(samples)), array_of(found.nodes),
                           array_of(found.heights), array_of(found.pressed), soil.step());
  }
  // Takes over what `memory` returned.
  void recall(Slots places, Rows<const SampleNumbers> samples, Slots nodes, Rows<const float> heights, Slots pressed,
              std::int32_t step) {
    const SoilLattice& lattice = soil.lattice;
    check_counts(places.size(), samples), check_counts(nodes.size(), heights);
    slots_below(places, static_cast<std::size_t>(lattice.rows()) * static_cast<std::size_t>(lattice.columns()));
    const std::size_t size =
        static_cast<std::size_t>(lattice.map().rows) * static_cast<std::size_t>(lattice.map().columns);
    slots_below(nodes, size), slots_below(pressed, size);
    SoilMemory memory{{places.begin(), places.end()},
                      {nodes.begin(), nodes.end()},
                      {pressed.begin(), pressed.end()},
                      {},
                      {heights.begin(), heights.end()}};
    for (const auto& [level, plastic, yielded, pressure, last] : samples) {
      if (!(std::abs(last) <= MOST_STEPS)) throw std::invalid_argument("the step of a sample is out of its range");
      memory.samples.push_back(
          {level, {plastic, yielded}, static_cast<float>(pressure), static_cast<std::int32_t>(last)});
    }
    if (step < 2) throw std::invalid_argument("the step of a soil is out of its range");
    const StepLock lock;
    soil.lattice.recall(memory);
    soil.go_on_from(step);
  }
  // Writes how far the ground of each sample of the map was pressed (rows, columns) [m].
  void sinkage(Array<double, 2> found) {
    const HeightGrid& map = soil.lattice.map();
    check_shape(found, static_cast<std::size_t>(map.rows), static_cast<std::size_t>(map.columns), "sinkage");
    const StepLock lock;
    soil.lattice.read_sinkage(found.data());
  }
};

// Returns for points (n, 2) [m] the underside of a shape [m], its normal there, and the share of a cell that it covers,
// (n, 5); and its half extents along columns and rows [m]. `of`: in axes of the grid. For tests.
auto shape_above_grid(const BodyShape& of, Rows<const Place> points, double spacing) {
  if (!is_primitive(of.outline.kind))
    throw std::invalid_argument("soil is pressed by boxes, balls, cylinders and capsules alone");
  const Underside shape = underside(Solid(of.outline, {}), spacing);
  UndersideRow row;
  std::vector<std::array<double, 5>> found;
  for (const auto& [x, y] : points) {
    row.x.assign(1, x), row.y = y;
    look_up(shape, row), cover(shape, row);
    const Vec3 normal = normal_at(shape, shape.grown, {x, y, row.low[0]});
    found.push_back({row.low[0], normal.x, normal.y, normal.z, row.share[0]});
  }
  return std::make_tuple(array_of(std::move(found)), half_extent(shape, 0), half_extent(shape, 1));
}

}  // namespace

SoilInStep& soil_of(nb::handle soil) { return nb::cast<Soil&>(soil).soil; }

void add_soil(nb::module_& m) {
  nb::class_<Soil>(m, "Soil")
      .def(nb::init<nb::object, Bytes2, Rows<const SoilType>, double>(), "grid"_a, "kinds"_a, "soils"_a, "spacing"_a)
      .def("set_kinds", &Soil::set_kinds, "kinds"_a)
      .def("take_pressed", &Soil::take_pressed)
      .def("memory", &Soil::memory)
      .def("recall", &Soil::recall, "places"_a, "samples"_a, "nodes"_a, "heights"_a, "pressed"_a, "step"_a)
      .def("sinkage", &Soil::sinkage, "found"_a)
      .def_prop_rw(
          "sinks_by_slip", [](const Soil& s) { return s.soil.lattice.sinks_by_slip; },
          [](Soil& s, bool on) {
            const StepLock lock;
            s.soil.lattice.sinks_by_slip = on;
          })
      .def("reset", [](Soil& s) {
        const StepLock lock;
        s.soil.lattice.reset();
      });
  m.def("shape_above_grid", &shape_above_grid, "shape"_a, "points"_a, "spacing"_a);
}

}  // namespace smartmesh
