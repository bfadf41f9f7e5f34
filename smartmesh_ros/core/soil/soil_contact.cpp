#include "soil/soil_contact.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Largest friction coefficient of a spring. Cohesion makes that of light bodies large without limit.
constexpr double MOST_FRICTION = 2.0;
// Most rounds of the search for the place of a body at the end of a step; Newton's method needs two to five. Relative
// error of the force at which it ends.
constexpr int ROUNDS = 30;
constexpr double LOAD_ERROR = 1e-6;
// Least vertical component of the normal by which a sample presses. That at the sample stands for its whole cell, and
// below the widest part of a wheel of ten samples' radius the mean over a cell is this.
constexpr double LEAST_VERTICAL = 0.35;
// Depth from which a body that appears in the soil has been put there [m].
constexpr double PUT_IN = 1e-3;
// By how much soil may be higher than the mean around it, which the map shows [m].
constexpr double HIGHER = 0.01;

// Returns by how much slip deepens a wheel's rut: Lyasko, Slip sinkage effect in soil-vehicle mechanics, 2010.
double slip_sinkage(double slip) { return (1.0 + slip) / (1.0 - 0.5 * slip); }

// Returns the vertical component of a normal that tells by how much a sample presses.
double pressing(const Vec3& normal) { return std::max(normal.z, LEAST_VERTICAL); }

// Returns the point of a round surface at the mean of some of its points: the speed of a rim decides which way a wheel
// without slip is held.
Vec3 on_surface(const Underside& shape, const Vec3& mean) {
  if (!rolls(shape.solid)) return mean;
  const Vec3 out = shape.kind == ShapeKind::Ball ? mean : perpendicular(mean, shape.axis(2));
  return mean + out * (shape.half[0] / norm(out) - 1.0);
}

}  // namespace

// Fills `under_` with the samples that a part whose rim slips reaches if it goes down by `deepest` [m]; zero = all
// whose level it is below, also those that have sunk away from it; then it makes room where soil was met from the side.
// `to_come`: the tilts and the heave of this step that `placed` lacks.
void SoilUnderBody::gather(SoilLattice& soil, const PlacedPart& placed, const MovingSolid& moving, double slip,
                           double deepest, const Vec3& to_come, const SoilStep& step) {
  under_.clear();
  const CellRange all = samples_around(soil, placed, half_extent(placed.shape, 0), half_extent(placed.shape, 1));
  if (all.empty()) return;
  // Of round shapes, that part is enough which may be below the highest ground.
  const double below = soil.highest(all) + HIGHER + deepest - placed.z;
  const auto [x, y] = half_extents_below(placed.shape, below);
  const CellRange under = samples_around(soil, placed, x, y);
  if (under.empty()) return;
  const double spacing = soil.spacing();
  const auto [top, left, bottom, right] = under;
  soil.renew(under, step.last);
  soils_.clear();
  for (int kind = 0; kind < soil.soil_count(); ++kind) {
    soils_.push_back(under_load(soil.soil(kind), contact_width(placed.shape), step.dt));
    if (soil.sinks_by_slip) soils_.back().modulus *= std::pow(slip_sinkage(slip), -soils_.back().exponent);
  }
  row_.x.resize(static_cast<std::size_t>(right - left));
  for (int c = left; c < right; ++c) row_.x[c - left] = (c - placed.column) * spacing;
  const Vec3 linear = placed.to_grid(moving.linear), angular = placed.to_grid(moving.angular);
  const bool is_level = placed.shape.is_level;  // then its upright faces do not lift it off samples on their edges
  // A round part passes a sample at the speed of its rim half a step ago: that is right to second order.
  const bool is_round = rolls(placed.shape.solid);
  Vec3 half_way = is_round ? Vec3{linear.x, linear.y, 0.0} * (0.5 * step.dt) : Vec3{};
  if (placed.shape.kind == ShapeKind::Cylinder)  // what passes on its rim is no flat end
    half_way = perpendicular(half_way, placed.shape.axis(2));
  for (int r = top; r < bottom; ++r) {
    row_.y = (r - placed.row) * spacing;
    look_up(placed.shape, row_), look_up_exact(placed.shape, row_, exact_);
    cover(placed.shape, row_);
    for (int c = left; c < right; ++c) {
      const int k = c - left;
      if (row_.low[k] == INFINITE) continue;
      const bool is_beside = exact_.low[k] == INFINITE || (is_level && exact_.low[k] > row_.low[k]);
      const double low = is_beside ? std::max(row_.low[k], placed.lowest) : exact_.low[k];
      const Vec3 offset{row_.x[k], row_.y, low};
      FineSample& sample = soil.at(r, c);
      if (!(placed.z + low - deepest < sample.level - (deepest > 0.0 ? sample.yield.plastic : 0.0))) continue;
      const Vec3 normal = placed.normal(offset, is_beside);
      const LoadedSoil& own = soils_[soil.kind(r, c)];
      const double loaded = sample.step >= step.last ? sample.pressure : 0.0;
      const Vec3 lever = lever_at(placed.shape.solid, offset, normal) * (1.0 / pressing(normal));
      const Vec3 passing = offset + half_way, facing = is_round ? placed.normal(passing, is_beside) : normal;
      const double rise = dot(linear + cross(angular, passing), facing) / pressing(facing) * step.dt;
      // The part was not above this sample in the last step, and did not go down as far as the soil stands above it: it
      // met a wall higher than itself from the side. Nobody pressed that soil, so it bears nothing and makes room.
      const double top = placed.z - placed.lowest + std::max(0.0, -rise);
      if (sample.step < step.last && sample.level - sample.yield.plastic > top) {
        if (deepest > 0.0) continue;
        sample.yield.plastic = sample.level - (placed.z + low);
        soil.note(r, c);
        continue;
      }
      const double before = placed.z + low - rise + dot(lever, to_come);
      const double surface = sample.level - sample.yield.plastic - loaded / own.elastic;
      const bool leaves = rise > 0.0;
      const double turns = leaves || loaded <= 0.0 ? before : INFINITE;
      under_.push_back({&sample, &own, r, c, offset, normal, lever, placed.z + low, before, turns, surface,
                        row_.share[k] * spacing * spacing, leaves});
    }
  }
}

// Adds the drag with which a `mass` [kg] on the soil as it is now sinks to rest without going beyond. Soil that is
// hardly pressed yet would be far too stiff: the deepest sinkage is that of all.
void SoilUnderBody::damp_critically(double mass, double dt) {
  double force = 0.0, deepest = 0.0, area = 0.0;
  for (const Under& under : under_) {
    const double sinkage = under.sample->level - under.low;
    area += under.area;
    if (!(sinkage > 0.0)) continue;
    const LoadedSoil& soil = *under.soil;
    deepest = std::max(deepest, sinkage);
    force +=
        under.area * std::min(soil.elastic * sinkage, soil.exponent * soil.modulus * std::pow(sinkage, soil.exponent));
  }
  if (!(force > 0.0)) return;
  for (LoadedSoil& soil : soils_) soil.drag += 2.0 * std::sqrt(force / deepest * mass) / (area * dt);
}

// Sets the loads of the samples for a part that went some way. Soil that a part entered from the side has not come down
// with it, so that is no speed that damps.
void SoilUnderBody::load(const Vec3& way) {
  for (Under& under : under_) {
    const double height = under.low + dot(under.lever, way), risen = under.risen_at(height);
    const double sinkage = under.sample->level - under.pressed_at(height), elastic = under.soil->elastic;
    const Yield& before = under.sample->yield;
    under.pressure = std::max(0.0, pressure_at(sinkage, before, *under.soil) - elastic * risen);
    const double drag = under.soil->drag * (std::min(under.before, under.surface) - height);
    under.total = under.pressure > 0.0 ? std::max(0.0, under.pressure + drag) : 0.0;
    const double stiffness = risen > 0.0 ? elastic : stiffness_at(sinkage, under.pressure, before, *under.soil);
    under.stiffness = under.total > 0.0 ? stiffness + under.soil->drag : 0.0;
  }
}

// Returns the way of a part in a step, and leaves the samples with their loads there. The forces of the samples are the
// `inertia`, over the square of the step's duration, times what the way lacks of the `free` one. That is the minimum of
// a convex energy. Newton's method finds it; its steps that go beyond the minimum along them are halved. `reach` [m]:
// of the part.
Vec3 SoilUnderBody::settle(const Mat3& inertia, const Vec3& free, const Vec3& start, double reach) {
  Vec3 from = start, way = start, further;
  double gain = 0.0;
  for (int round = 0; round < ROUNDS; ++round) {
    load(way);
    Vec3 lack = inertia * (free - way);
    Mat3 slope = inertia;
    double force = 0.0;
    for (const Under& under : under_) {
      force += under.area * under.total;
      lack = lack + under.lever * (under.area * under.total);
      for (int k = 0; k < 3; ++k)
        slope.row[k] = slope.row[k] + under.lever * (component(under.lever, k) * under.area * under.stiffness);
    }
    const double error = std::abs(lack.z) + (std::abs(lack.x) + std::abs(lack.y)) / reach;
    if (error <= LOAD_ERROR * std::max(norm(inertia * free), force)) break;
    if (dot(lack, further) < -0.5 * gain) {
      further = further * 0.5, gain *= 0.5;
    } else {
      from = way, further = solve(slope, lack), gain = dot(lack, further);
    }
    way = from + further;
  }
  return way;
}

// A quarter of the contact. Sums over its samples: forces of their pressures [N], and their places from the middle of
// the part [m], in axes of the grid as all here, weighted with these, strength of the shear stresses [N], and
// derivative of the force by the speed [N s/m].
struct SoilUnderBody::Quarter {
  Vec3 force, place, normal;
  double weight = 0.0, shear = 0.0, slope = 0.0;
};

// Fills the quarters about the middle of the pressures, along a level axis of the shape and across it, for a part at
// its place `then`; false if there are no pressures.
bool SoilUnderBody::find_quarters(const PlacedPart& placed, const ShearedRim& rim, const Solid& then, double dt,
                                  Quarter (&quarters)[4]) {
  double total = 0.0, x = 0.0, y = 0.0;
  for (const Under& under : under_) {
    if (!under.carries()) continue;
    const double force = under.area * under.total;
    total += force, x += force * under.offset.x, y += force * under.offset.y;
  }
  if (!(total > 0.0)) return false;
  x /= total, y /= total;
  const Underside& shape = placed.shape;
  const Vec3 along = shape.axis(lies(shape.solid) ? 2 : (shape.upright + 1) % 3);
  for (Under& under : under_) {
    if (!under.carries()) continue;
    const double u = under.offset.x - x, v = under.offset.y - y;
    under.quarter = (u * along.x + v * along.y > 0.0 ? 1 : 0) + (v * along.x - u * along.y > 0.0 ? 2 : 0);
    Quarter& quarter = quarters[under.quarter];
    const double area = under.area / pressing(under.normal), force = area * under.total;
    quarter.force = quarter.force + under.normal * force;
    quarter.place = quarter.place + under.offset * force;
    quarter.weight += force;
    const double sheared = rim.at(then, placed.to_world(under.offset), std::hypot(u, v));
    quarter.shear += area * shear_at(under.pressure, sheared, *under.soil);
  }
  for (Quarter& quarter : quarters)
    if (quarter.weight > 0.0) quarter.normal = unit(quarter.force);
  for (const Under& under : under_) {
    if (!under.carries()) continue;
    Quarter& quarter = quarters[under.quarter];
    const double part = dot(under.normal, quarter.normal) / pressing(under.normal);
    quarter.slope += under.area * under.stiffness * part * part * dt;
  }
  return true;
}

const std::vector<SoilSpring>& SoilUnderBody::find_springs(SoilLattice& soil, const MovingSolid& moving,
                                                           const Carried& carried, const ShearedRim& rim,
                                                           const SoilStep& step) {
  springs_.clear();
  const bool is_rolling = rolls(moving.solid);
  Solid then = moving.solid;  // at the end of the step, but for its way out of the plane
  then.centre = then.centre + Vec3{moving.linear.x, moving.linear.y, 0.0} * step.dt;
  const Vec3 own = moving.solid.axes.row[2], spin = is_rolling ? own * dot(moving.angular, own) : Vec3{};
  for (Vec3& axis : then.axes.row) axis = unit(axis + cross(spin, axis) * step.dt);
  const PlacedPart placed = place_above(soil, then, step.time);
  // Its way in the plane counts from there.
  const Vec3 velocity = placed.to_grid(tilts_and_heave(moving.solid, moving.angular, {0.0, 0.0, moving.linear.z}));
  const Mat3 inertia = inertia_of(placed.shape.solid, carried.mass);
  const Vec3 free = (velocity + solve(inertia, placed.to_grid(carried.load)) * step.dt) * step.dt;
  const double reach = placed.shape.solid.shape->extent({1.0, 1.0, 1.0});
  gather(soil, placed, moving, rim.slip(), std::max(0.0, -free.z) + (std::abs(free.x) + std::abs(free.y)) * reach,
         velocity * step.dt, step);
  if (carried.is_set_down) damp_critically(carried.mass, step.dt);
  const Vec3 way = settle(inertia * (1.0 / (step.dt * step.dt)), free, velocity * step.dt, reach);
  Quarter quarters[4];
  if (!find_quarters(placed, rim, then, step.dt, quarters)) return springs_;
  for (const Quarter& quarter : quarters) {
    if (!(quarter.slope > 0.0)) continue;
    const Vec3 normal = placed.to_world(quarter.normal),
               place = on_surface(placed.shape, quarter.place * (1.0 / quarter.weight));
    const Vec3 offset = placed.to_world(place);
    const double speed = dot(normal, moving.linear + cross(moving.angular, offset)) +
                         dot(way * (1.0 / step.dt) - velocity, lever_at(placed.shape.solid, place, quarter.normal));
    const double force = norm(quarter.force), friction = std::min(quarter.shear / force, MOST_FRICTION);
    springs_.push_back({moving.solid.centre + offset, normal, force, speed, quarter.slope, friction});
  }
  return springs_;
}

SoilSums SoilUnderBody::press(SoilLattice& soil, const MovingSolid& moving, ShearedRim& rim, const SoilStep& step) {
  const PlacedPart placed = place_above(soil, moving.solid, step.time);
  gather(soil, placed, moving, rim.slip(), 0.0, {}, step);
  load({});
  SoilSums sums;
  points_ = {{}, {}, soil.spacing(), placed.to_world({1.0, 0.0, 0.0})};
  for (const Under& under : under_) {
    FineSample& sample = *under.sample;
    sample.pressure = static_cast<float>(under.pressure), sample.step = step.number;
    if (under.pressure <= 0.0) continue;
    const double sinkage = sample.level - under.pressed_at(under.low) - under.risen_at(under.low);
    const double before = sample.yield.plastic;
    sample.yield = yield_after(sinkage, under.pressure, sample.yield, *under.soil);
    if (sample.yield.plastic > before) soil.note(under.row, under.column);
    if (!(under.area > 0.0)) continue;
    sums.carried += under.area * under.pressure, sums.area += under.area;
    sums.sinkage = std::max(sums.sinkage, sinkage);
    points_.offsets.push_back(placed.to_world(under.offset));
    points_.normals.push_back(placed.to_world(under.normal));
    points_.modulus += (under.soil->shear - points_.modulus) / static_cast<double>(points_.offsets.size());
  }
  rim.slide(moving, points_, step.dt);
  return sums;
}

void SoilUnderBody::make_room(SoilLattice& soil, const MovingSolid& moving, const SoilStep& step) {
  const PlacedPart placed = place_above(soil, moving.solid, step.time);
  gather(soil, placed, moving, 0.0, 0.0, {}, step);
  for (const Under& under : under_) {
    FineSample& sample = *under.sample;
    const double sinkage = sample.level - under.low;
    if (sinkage < sample.yield.plastic + PUT_IN) continue;
    sample.yield.plastic = sinkage;
    soil.note(under.row, under.column);
  }
}

}  // namespace smartmesh
