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
// Least share of a body that rests on a quarter of its contact.
constexpr double LEAST_SHARE = 0.05;
// Depth from which a body that appears in the soil has been put there [m].
constexpr double PUT_IN = 1e-3;
// By how much soil may be higher than the mean around it, which the map shows [m].
constexpr double HIGHER = 0.01;

// Returns by how much slip deepens a wheel's rut: Lyasko, Slip sinkage effect in soil-vehicle mechanics, 2010.
double slip_sinkage(double slip) { return (1.0 + slip) / (1.0 - 0.5 * slip); }

// Returns true if a part rolls: here it turns about its own axis alone, and its quarters go down by themselves.
bool rolls(const Solid& solid) { return solid.shape->kind == ShapeKind::Ball || lies(solid); }

// Returns the point of a round surface at the mean of some of its points: the speed of a rim decides which way a wheel
// without slip is held.
Vec3 on_surface(const Underside& shape, const Vec3& mean) {
  if (!rolls(shape.solid)) return mean;
  const Vec3 out = shape.kind == ShapeKind::Ball ? mean : mean - dot(mean, shape.axis(2)) * shape.axis(2);
  return mean + out * (shape.half[0] / norm(out) - 1.0);
}

}  // namespace

// Fills `under_` with the samples that a part whose rim slips reaches if it goes down by `deepest` [m]; zero = all
// whose level it is below, also those that have sunk away from it.
void SoilUnderBody::gather(SoilLattice& soil, const PlacedPart& placed, double slip, double deepest,
                           const SoilStep& step) {
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
  const bool leaves_sunk = rolls(placed.shape.solid) && deepest > 0.0;
  row_.x.resize(static_cast<std::size_t>(right - left));
  for (int c = left; c < right; ++c) row_.x[c - left] = (c - placed.column) * spacing;
  const bool is_level = stands_level(placed.shape);  // then its upright faces do not lift it off samples on their edges
  for (int r = top; r < bottom; ++r) {
    row_.y = (r - placed.row) * spacing;
    look_up(placed.shape, row_), look_up_exact(placed.shape, row_, exact_);
    cover(placed.shape, row_);
    for (int c = left; c < right; ++c) {
      const int k = c - left;
      if (row_.low[k] == INFINITE) continue;
      const bool is_beside = exact_.low[k] == INFINITE || (is_level && exact_.low[k] > row_.low[k]);
      const double low = is_beside ? std::max(row_.low[k], placed.lowest) : exact_.low[k];
      FineSample& sample = soil.at(r, c);
      // Left out are holes, and soil that has sunk too far to carry, unless the middles of quarters count it.
      if (!(placed.z + low - deepest < sample.level - (leaves_sunk ? sample.yield.plastic : 0.0))) continue;
      const LoadedSoil& own = soils_[soil.kind(r, c)];
      const double loaded = sample.step >= step.last ? sample.pressure : 0.0;
      under_.push_back({&sample,
                        &own,
                        r,
                        c,
                        is_beside,
                        {row_.x[k], row_.y, low},
                        placed.z + low,
                        sample.level - sample.yield.plastic - loaded / own.elastic,
                        row_.share[k] * spacing * spacing});
    }
  }
}

// Adds the drag with which a `mass` [kg] on the soil as it is now sinks to rest without going beyond.
void SoilUnderBody::damp_critically(double mass, double dt) {
  double stiffness = 0.0, area = 0.0;
  for (const Under& under : under_) {
    const double sinkage = under.sample->level - under.low;
    area += under.area;
    if (!(sinkage > 0.0)) continue;
    const LoadedSoil& soil = *under.soil;
    stiffness +=
        under.area * std::min(soil.elastic, soil.exponent * soil.modulus * std::pow(sinkage, soil.exponent - 1.0));
  }
  if (!(stiffness > 0.0)) return;
  for (LoadedSoil& soil : soils_) soil.drag += 2.0 * std::sqrt(stiffness * mass) / (area * dt);
}

// Sets the loads of the samples for a part that went `down` [m].
void SoilUnderBody::load(Span all, double down) {
  for (Under& under : all) {
    const double height = under.low - down, sinkage = under.sample->level - height;
    const Yield& before = under.sample->yield;
    under.pressure = pressure_at(sinkage, before, *under.soil);
    const double drag = under.soil->drag * (under.surface - height);
    under.total = under.pressure > 0.0 ? std::max(0.0, under.pressure + drag) : 0.0;
    under.stiffness = 0.0;
    if (under.total > 0.0)
      under.stiffness = stiffness_at(sinkage, under.pressure, before, *under.soil) + under.soil->drag;
  }
}

// Returns how far down a part goes in a step [m], at which the samples then have their loads: where the force of the
// soil and the part's inertia balance its load. Newton's method, with bisection where it leaves the bracket.
double SoilUnderBody::sink(Span all, const Carried& carried, double speed_down, double dt) {
  const double inertia = carried.mass / (dt * dt), free = speed_down * dt + carried.load / inertia;
  double low = free, high = free, trial = std::min(free, speed_down * dt);
  for (const Under& under : all) low = std::min(low, under.low - under.sample->level);
  for (int round = 0; round < ROUNDS; ++round) {
    load(all, trial);
    double force = 0.0, slope = inertia;
    for (const Under& under : all) force += under.area * under.total, slope += under.area * under.stiffness;
    const double lack = inertia * (free - trial) - force;
    if (std::abs(lack) <= LOAD_ERROR * std::max(carried.load, force)) break;
    (lack > 0.0 ? low : high) = trial;
    if (high - low < 1e-12) break;
    trial += lack / slope;
    if (!(low < trial && trial < high)) trial = 0.5 * (low + high);
  }
  return trial;
}

// A quarter of the contact: its samples, their `middle` from the middle of the part [m], in axes of the grid as all
// here, and the `share` of the load there. Sums over the samples: forces of their pressures [N], and their places
// weighted with these, strength of the shear stresses [N], and derivative of the force by the speed [N s/m].
struct SoilUnderBody::Quarter {
  Span under{nullptr, nullptr};
  Vec3 middle;
  double share = 0.0;
  Vec3 force, place, normal;
  double weight = 0.0, shear = 0.0, slope = 0.0;
};

// Finds the quarters about the middle of the pressures, along a level axis of the shape and across it; false if there
// are no pressures.
bool SoilUnderBody::find_quarters(const PlacedPart& placed, Quarter (&quarters)[4]) {
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
  int counts[4] = {};
  for (Under& under : under_) {
    const double u = under.offset.x - x, v = under.offset.y - y;
    under.quarter = (u * along.x + v * along.y > 0.0 ? 1 : 0) + (v * along.x - u * along.y > 0.0 ? 2 : 0);
    ++counts[under.quarter];
  }
  by_quarter_.resize(under_.size());
  Under* next = by_quarter_.data();
  for (int k = 0; k < 4; ++k) quarters[k].under = {next, next}, next += counts[k];
  for (const Under& under : under_) {
    Quarter& quarter = quarters[under.quarter];
    *quarter.under.last++ = under;
    quarter.middle = quarter.middle + under.offset * (1.0 / counts[under.quarter]);
    if (under.carries()) quarter.share += under.area * under.total / total;
  }
  return true;
}

// Fills the sums of a quarter whose samples have their loads, for a part at its place `then`.
void SoilUnderBody::sum(const PlacedPart& placed, const Solid& then, const ShearedRim& rim, double dt,
                        Quarter& quarter) {
  for (Under& under : quarter.under) {
    if (!under.carries()) continue;
    const Vec3 normal = under.normal = placed.normal(under.offset, under.is_beside);
    const double area = under.area / std::max(normal.z, STEEP), force = area * under.total;
    quarter.force = quarter.force + normal * force;
    quarter.place = quarter.place + under.offset * force;
    quarter.weight += force;
    quarter.shear += area * shear_at(under.pressure, rim.at(then, placed.to_world(under.offset)), *under.soil);
  }
  quarter.normal = unit(quarter.force);
  for (const Under& under : quarter.under) {
    if (!under.carries()) continue;
    const double part = dot(under.normal, quarter.normal) / std::max(under.normal.z, STEEP);
    quarter.slope += under.area * under.stiffness * part * part * dt;
  }
}

const std::vector<SoilSpring>& SoilUnderBody::find_springs(SoilLattice& soil, const MovingSolid& moving,
                                                           const Carried& carried, const ShearedRim& rim,
                                                           const SoilStep& step) {
  springs_.clear();
  const bool is_rolling = rolls(moving.solid);
  Solid then = moving.solid;  // at the end of the step, but for its vertical motion
  then.centre = then.centre + Vec3{moving.linear.x, moving.linear.y, 0.0} * step.dt;
  const Vec3 own = moving.solid.axes.row[2], spin = is_rolling ? own * dot(moving.angular, own) : Vec3{};
  for (Vec3& axis : then.axes.row) axis = unit(axis + cross(spin, axis) * step.dt);
  const PlacedPart placed = place_above(soil, then, step.time);
  const auto speed_down = [&](const Vec3& offset) {
    return -moving.linear.z - (is_rolling ? 0.0 : cross(moving.angular, placed.to_world(offset)).z);
  };
  const double by_rotation =
      is_rolling ? 0.0 : norm(moving.angular) * placed.shape.solid.shape->extent({1.0, 1.0, 1.0});
  const double deepest =
      (std::max(0.0, -moving.linear.z) + by_rotation + carried.load / carried.mass * step.dt) * step.dt;
  gather(soil, placed, rim.slip(), deepest, step);
  if (carried.is_set_down) damp_critically(carried.mass, step.dt);
  const Span all{under_.data(), under_.data() + under_.size()};
  const double of_all = sink(all, carried, -moving.linear.z, step.dt);
  Quarter quarters[4];
  if (!find_quarters(placed, quarters)) return springs_;
  for (Quarter& quarter : quarters) {
    const double share = std::max(quarter.share, LEAST_SHARE);
    const Carried part{share * carried.mass, share * carried.load};
    const double down = is_rolling ? of_all : sink(quarter.under, part, speed_down(quarter.middle), step.dt);
    sum(placed, then, rim, step.dt, quarter);
    if (!(quarter.slope > 0.0)) continue;
    const Vec3 normal = placed.to_world(quarter.normal);
    const Vec3 offset = placed.to_world(on_surface(placed.shape, quarter.place * (1.0 / quarter.weight)));
    Vec3 velocity = moving.linear + cross(moving.angular, offset);
    velocity.z += -down / step.dt + speed_down(quarter.middle);
    const double force = norm(quarter.force), friction = std::min(quarter.shear / force, MOST_FRICTION);
    springs_.push_back({moving.solid.centre + offset, normal, force, dot(normal, velocity), quarter.slope, friction});
  }
  return springs_;
}

SoilSums SoilUnderBody::press(SoilLattice& soil, const MovingSolid& moving, ShearedRim& rim, const SoilStep& step) {
  const PlacedPart placed = place_above(soil, moving.solid, step.time);
  gather(soil, placed, rim.slip(), 0.0, step);
  load({under_.data(), under_.data() + under_.size()}, 0.0);
  SoilSums sums;
  points_ = {{}, {}, soil.spacing(), placed.to_world({1.0, 0.0, 0.0})};
  for (const Under& under : under_) {
    FineSample& sample = *under.sample;
    sample.pressure = static_cast<float>(under.pressure), sample.step = step.number;
    if (under.pressure <= 0.0) continue;
    const double sinkage = sample.level - under.low, before = sample.yield.plastic;
    sample.yield = yield_after(sinkage, under.pressure, sample.yield, *under.soil);
    if (sample.yield.plastic > before) soil.note(under.row, under.column);
    if (!(under.area > 0.0)) continue;
    sums.carried += under.area * under.pressure, sums.area += under.area;
    sums.sinkage = std::max(sums.sinkage, sinkage);
    points_.offsets.push_back(placed.to_world(under.offset));
    points_.normals.push_back(placed.to_world(placed.normal(under.offset, under.is_beside)));
  }
  rim.slide(moving, points_, step.dt);
  return sums;
}

void SoilUnderBody::make_room(SoilLattice& soil, const MovingSolid& moving, const SoilStep& step) {
  const PlacedPart placed = place_above(soil, moving.solid, step.time);
  gather(soil, placed, 0.0, 0.0, step);
  for (const Under& under : under_) {
    FineSample& sample = *under.sample;
    const double sinkage = sample.level - under.low;
    if (sinkage < sample.yield.plastic + PUT_IN) continue;
    const double pressure = under.soil->modulus * std::pow(sinkage, under.soil->exponent);
    sample.yield = {sinkage, std::max(sample.yield.yielded, pressure)};
    soil.note(under.row, under.column);
  }
}

}  // namespace smartmesh
