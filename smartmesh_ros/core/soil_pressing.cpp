#include "soil_pressing.h"

#include "window.h"

namespace smartmesh {

namespace {

// Largest friction coefficient of a body. Cohesion makes that of light bodies large without limit.
constexpr double MOST_GRIP = 2.0;
// Smaller loads count as none [N].
constexpr double LEAST_LOAD = 1e-6;
constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr double UNKNOWN = std::numeric_limits<double>::quiet_NaN();

// A shape in its place: `middle`, fractional column and row, and height [m] without the grid's z; velocity [m/s] of the
// middle, and spin [rad/s], in axes of the grid; `size` [m], more than half its length along columns and rows.
struct PlacedShape {
  Underside shape;
  Vec3 middle, linear, angular;
  double size;
};

Vec3 to_grid_axes(const GridPose& pose, const Vec3& v) {
  return {pose.cos * v.x + pose.sin * v.y, pose.cos * v.y - pose.sin * v.x, v.z};
}

PlacedShape place(const SoilGround& ground, const Foot& foot) {
  Solid solid(foot.shape, foot.body.pose);
  const Vec3 offset = rotated(foot.body.pose.turn, foot.shape.offset), at = solid.centre;
  for (Vec3& axis : solid.axes.row) axis = to_grid_axes(ground.pose, axis);
  const GridPoint point = to_grid(ground.pose, ground.spacing, at.x, at.y);
  PlacedShape placed{underside(solid, ground.spacing),
                     {point.column, point.row, at.z - ground.z},
                     to_grid_axes(ground.pose, foot.body.linear + cross(foot.body.angular, offset)),
                     to_grid_axes(ground.pose, foot.body.angular), 0.0};
  placed.size = std::max(half_length(placed.shape, 0), half_length(placed.shape, 1)) + 2.0 * ground.spacing;
  return placed;
}

// Filters the load of a body, and its place, which noisy contacts change within a step.
void filter_load(Foot& foot, const SoilUpdate& update) {
  const auto share_in = [&](double time) { return time > 0.0 ? -std::expm1(-update.dt / time) : 1.0; };
  foot.load.force += share_in(update.load_time) * (foot.given.force - foot.load.force);
  if (!(foot.given.force > 0.0)) return;
  const double share = share_in(update.lean_time) * std::min(foot.given.force / foot.load.force, 1.0);
  foot.load.x += share * (foot.given.x - foot.load.x);
  foot.load.y += share * (foot.given.y - foot.load.y);
}

// Returns a number without its fraction, limited to a range; NaN becomes `low`.
int whole_within(double value, int low, int high) {
  if (!(value > low)) return low;
  return value < high ? static_cast<int>(value) : high;
}

// Returns the samples that a shape may be above; none for a body that was thrown to infinity.
SampleRectangle rectangle_under(const SoilGround& ground, const PlacedShape& placed) {
  const Vec3& middle = placed.middle;
  const double wide = reach(placed.shape, 0) / ground.spacing, high = reach(placed.shape, 1) / ground.spacing;
  if (!std::isfinite(middle.x + middle.y + middle.z + wide + high)) return {};
  return {whole_within(middle.y - high, 0, ground.rows), whole_within(middle.x - wide, 0, ground.columns),
          std::min(whole_within(middle.y + high, -2, ground.rows) + 1, ground.rows - 1),
          std::min(whole_within(middle.x + wide, -2, ground.columns) + 1, ground.columns - 1)};
}

// Fills `samples` with those under a shape, without the values of their soil.
void find_under(SoilGround& ground, const PlacedShape& placed, FootRow& row, std::vector<UnderSample>& samples) {
  const SampleRectangle around = rectangle_under(ground, placed);
  if (around.empty()) return samples.clear();
  const int columns = around.right - around.left + 1;
  samples.resize(static_cast<std::size_t>(around.bottom - around.top + 1) * columns);
  row.x.resize(static_cast<std::size_t>(columns));
  for (int k = 0; k < columns; ++k) row.x[k] = (around.left + k - placed.middle.x) * ground.spacing;
  std::size_t count = 0;
  for (int r = around.top; r <= around.bottom; ++r) {
    row.y = (r - placed.middle.y) * ground.spacing;
    look_up(placed.shape, row), cover(placed.shape, row);
    const double* now = ground.now(r, around.left, columns);
    const double y = row.y / placed.size;
    for (int k = 0; k < columns; ++k) {
      if (row.low[k] == INFINITE || std::isnan(now[k])) continue;
      UnderSample& sample = samples[count++];
      sample.row = r, sample.column = around.left + k;
      sample.low = placed.middle.z + row.low[k], sample.now = now[k];
      sample.area = row.share[k] * ground.spacing * ground.spacing;
      sample.x = row.x[k] / placed.size, sample.y = y;
    }
  }
  samples.resize(count);
}

// Keeps the samples that the body reaches if it goes down by `deepest` and leans by `most` [m], and takes their ground
// into the layer.
void keep_within(SoilGround& ground, double deepest, double most, const std::vector<PatchSoil>& soils,
                 std::vector<UnderSample>& samples) {
  std::size_t count = 0;
  for (UnderSample& sample : samples) {
    const int r = sample.row, c = sample.column;
    const LayerSample& own = ground.at(r, c);
    const bool known = ground.knows(r, c);
    sample.level = known ? own.level : static_cast<double>(ground.mapped(r, c));
    if (sample.low - deepest - most * (std::abs(sample.x) + std::abs(sample.y)) > sample.level) continue;
    if (!known) ground.note(r, c);
    sample.soil = &soils[ground.kind(r, c)];
    sample.before = {own.plastic, own.yielded};
    if (&samples[count] != &sample) samples[count] = sample;
    ++count;
  }
  samples.resize(count);
}

// Returns the velocity at which the body's surface shears the soil at a sample, along columns and rows [m/s]: its size
// is that of the velocity along the surface.
Slope slip_at(const PlacedShape& placed, const UnderSample& sample) {
  const Vec3& middle = placed.middle;
  const double spacing = placed.shape.spacing;
  const Vec3 p{(sample.column - middle.x) * spacing, (sample.row - middle.y) * spacing, sample.low - middle.z};
  const Vec3 velocity = placed.linear + cross(placed.angular, p);
  const Vec3 normal = normal_at(placed.shape, p);
  const Vec3 along = velocity - dot(velocity, normal) * normal;
  const double level = std::sqrt(along.x * along.x + along.y * along.y);
  const double share = level > 1e-12 ? norm(along) / level : 0.0;
  return {along.x * share, along.y * share};
}

// Shears the soil under the samples by the motion of the body's surface.
void shear(SoilGround& ground, const PlacedShape& placed, double dt, std::vector<UnderSample>& samples) {
  for (UnderSample& sample : samples) {
    if (sample.load.total <= 0.0) continue;
    LayerSample& own = ground.at(sample.row, sample.column);
    const Slope slip = slip_at(placed, sample);
    own.shear_x = static_cast<float>(own.shear_x + slip.x * dt);
    own.shear_y = static_cast<float>(own.shear_y + slip.y * dt);
    sample.slid = std::sqrt(own.shear_x * own.shear_x + own.shear_y * own.shear_y);
  }
}

// Presses the samples down by a lean, whose loads they have, and writes the results to the foot. Its loops are apart,
// because a processor works ahead in short ones.
void settle(SoilGround& ground, const PlacedShape& placed, const SoilUpdate& update, const Lean& lean,
            std::vector<UnderSample>& samples, Foot& foot) {
  for (UnderSample& sample : samples)
    if (!(sample.area > 0.0)) sample.load = load_at(sample, lean, update.dt);
  shear(ground, placed, update.dt, samples);
  double carried = 0.0, area = 0.0, deepest = 0.0, displaced = 0.0, resistance = 0.0;
  const double cell = ground.spacing * ground.spacing;
  SampleRectangle pressed;
  for (const UnderSample& sample : samples) {
    const double pressure = sample.load.pressure;
    if (sample.load.total <= 0.0) continue;
    LayerSample& own = ground.at(sample.row, sample.column);
    const double height = pressed_to(sample, lean), sinkage = own.level - height;
    const float before = own.plastic;
    const Yield after = yield_after(sinkage, pressure, {own.plastic, own.yielded}, *sample.soil);
    own.plastic = static_cast<float>(after.plastic), own.yielded = static_cast<float>(after.yielded);
    own.pressure = static_cast<float>(pressure);
    // Two bodies on a sample: the deeper one counts.
    own.target = own.pressed == update.number ? std::min(own.target, height) : height;
    own.pressed = update.number;
    displaced += (own.plastic - before) * cell;
    carried += sample.area * pressure;
    area += sample.area;
    deepest = std::max(deepest, sinkage);
    pressed.add(sample.row, sample.column);
  }
  for (const UnderSample& sample : samples)
    if (sample.load.total > 0.0) resistance += sample.area * shear_at(sample.load.pressure, sample.slid, *sample.soil);
  foot.carried = carried, foot.area = area, foot.sinkage = deepest, foot.displaced = displaced, foot.pressed = pressed;
  foot.grip = std::min(resistance / foot.load.force, MOST_GRIP);
}

// Returns where the body goes so that the soil carries its load.
Lean find_lean(const SoilGround& ground, const Foot& foot, const PlacedShape& placed, const SoilUpdate& update,
               double touch, std::vector<UnderSample>& samples) {
  const bool was_carried = !std::isnan(foot.seat);
  const double deepest = touch + update.deepest;
  const Slope own = slope_of(placed.shape);
  Lean lean{touch, 0.0, 0.0};
  if (was_carried) lean.down = std::min(placed.middle.z - foot.seat, deepest);
  if (placed.shape.kind != ShapeKind::Ball && !std::isnan(foot.load.x)) {  // a ball does not lean
    if (was_carried) {
      const double most = update.deepest;
      lean.x = std::min(std::max((own.x - foot.slope.x) * placed.size, -most), most);
      lean.y = std::min(std::max((own.y - foot.slope.y) * placed.size, -most), most);
    }
    const double share = foot.load.force / placed.size;
    const Vec3 at = to_grid_axes(ground.pose, {foot.load.x, foot.load.y, 0.0});
    const Wanted wanted{foot.load.force, share * at.x, share * at.y, deepest, update.deepest};
    if (lean_over(samples, wanted, update.dt, lean)) return lean;
  }
  lean.down = balance(samples, foot.load.force, lean, deepest, update.dt);
  return lean;
}

}  // namespace

void press(SoilGround& ground, Foot& foot, const SoilUpdate& update, PressingScratch& scratch) {
  filter_load(foot, update);
  foot.sinkage = foot.area = foot.carried = foot.grip = foot.displaced = 0.0;
  foot.pressed = {};
  if (foot.load.force <= LEAST_LOAD) {
    foot.load = {0.0, 0.0, 0.0};
    foot.seat = UNKNOWN;
    return;
  }
  const PlacedShape placed = place(ground, foot);
  std::vector<UnderSample>& samples = scratch.samples;
  find_under(ground, placed, scratch.row, samples);
  double touch = INFINITE;
  for (const UnderSample& sample : samples)
    if (sample.area > 0.0) touch = std::min(touch, sample.low - sample.now);
  if (touch == INFINITE) return;
  scratch.soils.clear();
  for (int kind = 0; kind < ground.soil_count(); ++kind)
    scratch.soils.push_back(under_patch(ground.soil(kind), patch_width(placed.shape), update.dt));
  keep_within(ground, touch + update.deepest, update.deepest, scratch.soils, samples);
  const Lean lean = find_lean(ground, foot, placed, update, touch, samples);
  foot.seat = placed.middle.z - lean.down;
  const Slope own = slope_of(placed.shape);
  foot.slope = {own.x - lean.x / placed.size, own.y - lean.y / placed.size};
  settle(ground, placed, update, lean, samples, foot);
}

}  // namespace smartmesh
