// What Python sees of soil.
#include "soil.h"
#include "tables.h"

namespace smartmesh {
namespace {

using Records = Array<std::uint8_t, 2>;
using Layer = Array<std::uint8_t, 3>;
constexpr double DEGREE = 3.14159265358979323846 / 180.0;

bool is_in(const SampleRectangle& r, int rows, int columns) {
  if (r.top == NOWHERE) return r.left == NOWHERE && r.bottom == -1 && r.right == -1;
  return 0 <= r.top && r.top <= r.bottom && r.bottom < rows && 0 <= r.left && r.left <= r.right && r.right < columns;
}

double in_range(nb::handle config, const char* name, double low, double high) {
  const double value = nb::cast<double>(config.attr(name));
  if (!(value >= low && value <= high)) throw std::invalid_argument(std::string(name) + " is out of its range");
  return value;
}

// Returns the settings of an update from a SoilConfig.
SoilUpdate settings_of(nb::handle config, const HeightGrid& grid, double dt, std::int32_t number) {
  constexpr double most = 1e9;
  SoilUpdate update;
  update.dt = dt, update.number = number;
  update.load_time = in_range(config, "load_time", 0.0, most);
  update.lean_time = in_range(config, "lean_time", 0.0, most);
  update.deepest = in_range(config, "fastest", 0.0, most) * dt;
  update.flow = in_range(config, "flow", 0.0, 1.0);
  update.drop = std::tan(in_range(config, "repose", 0.0, 90.0) * DEGREE) * grid.resolution;
  update.rim = static_cast<int>(in_range(config, "rim", 0.0, 1000.0));
  update.slides = static_cast<int>(in_range(config, "slides", 0.0, 1000.0));
  update.still = in_range(config, "still", 0.0, most) * dt;
  update.farthest = in_range(config, "flow_speed", 0.0, most) * dt;
  // Ground that does not move on by its velocities jumps.
  update.carried = grid.mode == Mode::Extrapolate ? in_range(config, "carried_speed", 0.0, most) * dt : 0.0;
  return update;
}

void check_kind(const Shape& shape) {
  if (!is_primitive(shape.kind))
    throw std::invalid_argument("soil is pressed by boxes, balls, cylinders and capsules alone");
}

// A soil's arrays, which stay alive with it.
struct SoilOfMap {
  Layer samples;
  Bytes2 kinds;
  Doubles2 soils;
  Soil soil;

  SoilOfMap(Layer samples_rc, Bytes2 kinds_rc, Doubles2 soils_s)
      : samples(samples_rc), kinds(kinds_rc), soils(soils_s) {
    const std::size_t rows = samples.shape(0), columns = samples.shape(1);
    if (rows < 2 || columns < 2 || rows > (1u << 24) || columns > (1u << 24))
      throw std::invalid_argument("a soil has 2 to 2^24 rows and columns");
    if (samples.shape(2) != sizeof(LayerSample)) throw std::invalid_argument("samples must be records of LAYER_SAMPLE");
    if (kinds.shape(0) != rows || kinds.shape(1) != columns)
      throw std::invalid_argument("kinds must have the rows and columns of samples");
    if (soils.shape(0) < 1 || soils.shape(0) > 255 || soils.shape(1) * sizeof(double) != sizeof(SoilType))
      throw std::invalid_argument("soils must have the shape (S, 8), with 1 to 255 soils");
    check_alignment(samples.data(), alignof(LayerSample)), check_alignment(soils.data(), sizeof(double));
    SoilLayer layer;
    layer.samples = reinterpret_cast<LayerSample*>(samples.data());
    layer.kinds = kinds.data(), layer.soils = reinterpret_cast<const SoilType*>(soils.data());
    layer.soil_count = static_cast<int>(soils.shape(0));
    layer.rows = static_cast<int>(rows), layer.columns = static_cast<int>(columns);
    soil = Soil(layer);
  }

  // Presses the feet (n,) into the soil; returns the changed rectangles (m, 4), and heights and velocities (N,).
  auto update(const Grid& grid, Records feet, double time, double dt, std::int32_t number, nb::handle config) {
    if (grid.grid.rows != soil.rows() || grid.grid.columns != soil.columns())
      throw std::invalid_argument("the grid must have the rows and columns of the soil");
    if (!(std::isfinite(time) && std::isfinite(dt) && dt > 0.0))
      throw std::invalid_argument("the time must be finite, and dt above zero");
    Foot* first = records_of<Foot>(feet, "feet");
    for (std::size_t k = 0; k < feet.shape(0); ++k) {
      check_kind(first[k].shape);
      if (!is_in(first[k].seen, soil.rows(), soil.columns()))
        throw std::invalid_argument("a foot has seen samples that are not there");
    }
    const SoilChanges found = soil.update(grid.grid, time, settings_of(config, grid.grid, dt, number), first, feet.shape(0));
    const std::size_t count = found.rectangles.size(), size = found.heights.size();
    std::vector<std::int64_t> places;
    for (const SampleRectangle& r : found.rectangles) places.insert(places.end(), {r.top, r.left, r.bottom, r.right});
    return std::make_tuple(array_of<std::int64_t, 2>(places, {count, 4}), array_of<float, 1>(found.heights, {size}),
                           array_of<float, 1>(found.velocities, {size}));
  }
};

// Returns for points (n, 2) [m] the underside of a shape [m], its normal there, and the share of a cell that it covers,
// (n, 5); and its reach along columns and rows [m]. `record` (1, ...): of SHAPE, in axes of the grid. For tests.
std::tuple<NewTable, double, double> shape_above_grid(Bytes2 record, Doubles2 points, double spacing) {
  check_table(record, 1, sizeof(Shape), "the record"), check_table(points, points.shape(0), 2, "points");
  const Shape& own = *records_of<Shape>(record, "the record");
  check_kind(own);
  const Underside shape = underside(Solid(own, {}), spacing);
  FootRow row;
  std::vector<double> found;
  for (std::size_t k = 0; k < points.shape(0); ++k) {
    row.x.assign(1, points.data()[2 * k]), row.y = points.data()[2 * k + 1];
    look_up(shape, row), cover(shape, row);
    const Vec3 normal = normal_at(shape, {row.x[0], row.y, row.low[0]});
    found.insert(found.end(), {row.low[0], normal.x, normal.y, normal.z, row.share[0]});
  }
  return {array_of<double, 2>(found, {points.shape(0), 5}), reach(shape, 0), reach(shape, 1)};
}

}  // namespace

void add_soil(nb::module_& m) {
  nb::class_<SoilOfMap>(m, "Soil")
      .def(nb::init<Layer, Bytes2, Doubles2>(), "samples"_a.noconvert(), "kinds"_a.noconvert(), "soils"_a.noconvert())
      .def("update", &SoilOfMap::update, "grid"_a, "feet"_a.noconvert(), "time"_a, "dt"_a, "number"_a, "config"_a);
  m.def("shape_above_grid", &shape_above_grid, "record"_a.noconvert(), "points"_a.noconvert(), "spacing"_a);
}

}  // namespace smartmesh
