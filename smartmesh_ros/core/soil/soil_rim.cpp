#include "soil/soil_rim.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

constexpr double TURN = 6.283185307179586;
// Rim speed below which a wheel stands still [m/s].
constexpr double STILL = 1e-4;

// Returns the shear displacement with the stress that soil has after a further `way` [m]. By Janosi and Hanamoto's law
// the stress comes to the strength against the motion of the moment over the `modulus` [m], whatever it was before: as
// shares of the strength, d(stress) = (direction - stress) |d(way)| / modulus.
Vec3 sheared_on(const Vec3& before, const Vec3& way, double modulus) {
  const double sheared = norm(before), further = norm(way);
  if (!(further > 0.0)) return before;
  const Vec3 direction = way * (1.0 / further);
  const Vec3 stress = sheared > 0.0 ? before * (-std::expm1(-sheared / modulus) / sheared) : Vec3{};
  const Vec3 after = direction + (stress - direction) * std::exp(-further / modulus);
  const double size = norm(after);
  return size > 0.0 ? after * (std::min(sheared + further, -modulus * std::log1p(-size)) / size) : Vec3{};
}

// Where a contact begins and ends along a direction, from the middle of a part [m].
struct Stretch {
  double from, to;
};

// Returns the stretch of a contact along a direction: that of a rectangle with the second moment of its cells. The
// outermost cells of a contact askew to the grid stand out of it by more than those of one along the grid.
Stretch stretch_along(const Vec3& direction, const PointsInSoil& points) {
  const double count = static_cast<double>(points.offsets.size()), half_cell = 0.5 * points.spacing;
  double middle = 0.0, moment = half_cell * half_cell / 3.0, from = INFINITE, to = -INFINITE;
  for (const Vec3& offset : points.offsets) middle += dot(offset, direction) / count;
  for (const Vec3& offset : points.offsets) {
    const double place = dot(offset, direction);
    moment += (place - middle) * (place - middle) / count;
    from = std::min(from, place - half_cell), to = std::max(to, place + half_cell);
  }
  const double half = std::sqrt(3.0 * moment);
  return {std::max(from, middle - half), std::min(to, middle + half)};
}

}  // namespace

double ShearedRim::at(const Solid& solid, const Vec3& offset, double away) const {
  if (slides_.empty()) return 0.0;
  std::size_t place = 0;
  if (lies_) {
    const Vec3 own = solid.axes * offset;
    place = static_cast<std::size_t>((std::atan2(own.y, own.x) / TURN + 1.0) * PLACES) % PLACES;
  }
  const Slide& slide = slides_[place];
  return std::sqrt(slide.around * slide.around + slide.along * slide.along + slide.turned * slide.turned * away * away);
}

void ShearedRim::write(std::vector<double>& numbers) const {
  numbers.insert(numbers.end(), {static_cast<double>(lies_), slip_});
  for (const Slide& slide : slides_) numbers.insert(numbers.end(), {slide.around, slide.along, slide.turned});
}

bool ShearedRim::read(const double* numbers, std::size_t count) {
  if (count < 2 || (count - 2) % 3 != 0) return false;
  lies_ = numbers[0] != 0.0, slip_ = numbers[1];
  const std::size_t places = (count - 2) / 3;
  slides_.clear();
  for (std::size_t k = 0; k < places; ++k)
    slides_.push_back({numbers[2 + 3 * k], numbers[3 + 3 * k], numbers[4 + 3 * k]});
  return places == 0 || places == (lies_ ? PLACES : 1);
}

void ShearedRim::slide(const MovingSolid& moving, const PointsInSoil& points, double dt) {
  if (points.offsets.empty()) return reset();
  const bool lies_now = lies(moving.solid);
  if (lies_now != lies_) reset();
  lies_ = lies_now;
  slides_.resize(lies_ ? PLACES : 1);
  if (lies_)
    slide_places(moving, points, dt);
  else
    slide_all(moving, points, dt);
}

void ShearedRim::slide_all(const MovingSolid& moving, const PointsInSoil& points, double dt) {
  const double count = static_cast<double>(points.offsets.size());
  Vec3 velocity = moving.surface, normal{}, middle{};
  for (std::size_t k = 0; k < points.offsets.size(); ++k) {
    velocity = velocity + (moving.linear + cross(moving.angular, points.offsets[k])) * (1.0 / count);
    normal = normal + points.normals[k], middle = middle + points.offsets[k] * (1.0 / count);
  }
  normal = unit(normal);
  double spread = points.spacing * points.spacing / 6.0;  // second moment of the contact, over its area
  for (const Vec3& offset : points.offsets) spread += norm2(cross(normal, offset - middle)) / count;
  const double arm = std::sqrt(spread);
  const Vec3 u = unit(cross(points.grid, normal)), v = cross(normal, u);
  Slide& slide = slides_[0];
  const Vec3 way = Vec3{dot(velocity, u), dot(velocity, v), dot(moving.angular, normal) * arm} * dt;
  const Vec3 sheared = sheared_on({slide.around, slide.along, slide.turned * arm}, way, points.modulus);
  slide = {sheared.x, sheared.y, sheared.z / arm};
  const bool is_ball = moving.solid.shape->kind == ShapeKind::Ball;
  const Vec3 passing = is_ball ? cross(moving.angular, normal) * moving.solid.shape->rounding : moving.surface;
  const double speed = norm(passing);
  if (!(speed > 0.0)) return;
  const auto [from, to] = stretch_along(passing * (1.0 / speed), points);
  // The mean displacement of a surface that shears the soil from the edge of the contact on is half that at its end.
  const double stays = std::exp(-2.0 * speed * dt / (to - from));
  slide.around *= stays, slide.along *= stays, slide.turned *= stays;
}

void ShearedRim::slide_places(const MovingSolid& moving, const PointsInSoil& points, double dt) {
  const Solid& solid = moving.solid;
  const Vec3 axis = solid.axes.row[2], down = unit(Vec3{0.0, 0.0, -1.0} + axis * axis.z), ahead = cross(axis, down);
  double radius = 0.0;
  for (const Vec3& offset : points.offsets) radius = std::max(radius, norm(perpendicular(offset, axis)));
  const auto [from, to] = stretch_along(ahead, points);
  const double first = std::asin(std::max(from / radius, -1.0)), last = std::asin(std::min(to / radius, 1.0));
  const double lowest = std::atan2(dot(solid.axes.row[1], down), dot(solid.axes.row[0], down));  // in the part's frame
  for (int k = 0; k < PLACES; ++k) {
    const double own = (k + 0.5) / PLACES * TURN, beyond = own - lowest;
    const double angle = beyond > 0.5 * TURN ? beyond - TURN : beyond;
    if (angle < first || angle > last) {
      slides_[k] = {};
      continue;
    }
    const Vec3 out = solid.axes.row[0] * std::cos(own) + solid.axes.row[1] * std::sin(own);
    const Vec3 velocity = moving.linear + cross(moving.angular, out * radius) + moving.surface;
    slides_[k].around += dot(velocity, cross(axis, out)) * dt;
    slides_[k].along += dot(velocity, axis) * dt;
    slides_[k].turned += dot(moving.angular, out) * dt;
  }
  const double rolling = -dot(moving.angular, axis) * radius;  // speed of the wheel without slip
  if (std::abs(rolling) < STILL) return;
  const double now = std::min(std::max(1.0 - dot(moving.linear, ahead) / rolling, 0.0), 1.0);
  slip_ += (now - slip_) * -std::expm1(-std::abs(rolling) * dt / ((last - first) * radius));
}

}  // namespace smartmesh
