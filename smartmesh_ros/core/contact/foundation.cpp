#include "contact/foundation.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Rows, and samples in each.
constexpr int SIDE = 12;
// Halvings of a step between samples in which the end of a row is found.
constexpr int HALVINGS = 6;
// Slope of a plane across the axis of a cylinder, below which the cylinder stands upright on it.
constexpr double UPRIGHT = 1e-9;

// The points p with dot(normal, p) = offset; `normal`: unit.
struct Plane {
  Vec3 normal;
  double offset;
};

// A point of a plane above a part of a shape that is below it, in the shape's frame: how deep the shape goes there [m],
// and the area that the point stands for [m^2].
struct DepthSample {
  Vec3 point;
  double depth, area;
};

// A rectangle in a plane, with its sides along two axes, that grows around points.
struct Rectangle {
  Vec3 along, across;
  double low[2] = {INFINITE, INFINITE}, high[2] = {-INFINITE, -INFINITE};

  // `level`: a direction in the plane or near it.
  Rectangle(const Vec3& normal, const Vec3& level)
      : along(unit(perpendicular(level, normal))), across(cross(normal, along)) {}
  void add(const Vec3& p, double grown = 0.0) {
    const double at[2] = {dot(p, along), dot(p, across)};
    for (int k = 0; k < 2; ++k) low[k] = std::min(low[k], at[k] - grown), high[k] = std::max(high[k], at[k] + grown);
  }
  bool empty() const { return !(low[0] < high[0] && low[1] < high[1]); }
};

// Returns half the width of a circle at a height above its lowest point, of its lower half where that is wider.
double half_width(double radius, double height) {
  return height < radius ? std::sqrt(std::max(0.0, height * (2.0 * radius - height))) : radius;
}

// Adds the part of a segment that is below a plane; `add` gets its ends and their depths.
template <class Add>
void add_segment(const Vec3& p, const Vec3& q, const Plane& plane, const Add& add) {
  const double a = plane.offset - dot(plane.normal, p), b = plane.offset - dot(plane.normal, q);
  if (a > 0.0) add(p, a);
  if (b > 0.0) add(q, b);
  if ((a > 0.0) != (b > 0.0)) add(p + (q - p) * (a / (a - b)), 0.0);
}

// Returns that axis of a shape which is the most level in a plane: rectangles of boxes then fit.
Vec3 level_axis(const Vec3& normal) {
  const double x = std::abs(normal.x), y = std::abs(normal.y), z = std::abs(normal.z);
  if (z <= x && z <= y) return {0.0, 0.0, 1.0};
  return x <= y ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0};
}

// Returns the rectangle around what is below a plane of a cylinder: of the circles at the ends of that part of its
// lowest line which is below.
Rectangle around_cylinder(const Convex& shape, const Plane& plane) {
  const double radius = shape.half.x, slope = std::hypot(plane.normal.x, plane.normal.y);
  const Vec3 up = slope > UPRIGHT ? Vec3{plane.normal.x, plane.normal.y, 0.0} * (1.0 / slope) : Vec3{1.0, 0.0, 0.0};
  const Vec3 end{0.0, 0.0, shape.half.z}, side = cross({0.0, 0.0, 1.0}, up), lowest = up * -radius;
  Rectangle around(plane.normal, side);
  add_segment(lowest - end, lowest + end, plane, [&](const Vec3& p, double depth) {
    const double height = std::min(2.0 * radius, depth / std::max(slope, UPRIGHT)), half = half_width(radius, height);
    const Vec3 widest = p + up * std::min(height, radius);
    for (const Vec3& point : {p, p + up * height, widest + side * half, widest - side * half}) around.add(point);
  });
  return around;
}

Rectangle around_part(const Convex& shape, const Plane& plane) {
  if (shape.kind == ShapeKind::Cylinder) return around_cylinder(shape, plane);
  const Polytope& core = shape.core;
  const Plane of_core{plane.normal, plane.offset + shape.rounding};
  Rectangle around(plane.normal, level_axis(plane.normal));
  if (core.faces.empty()) {  // a ball or a capsule
    add_segment(core.vertices.front(), core.vertices.back(), of_core,
                [&](const Vec3& p, double depth) { around.add(p, half_width(shape.rounding, depth)); });
  }
  for (const PolyEdge& edge : core.edges)
    if (!core.faces.empty())
      add_segment(core.vertices[edge.end[0]], core.vertices[edge.end[1]], of_core,
                  [&](const Vec3& p, double) { around.add(p, shape.rounding); });
  return around;
}

// A row of a rectangle: points at `start` + t `along`, t from 0 to 1.
struct Row {
  const Convex& shape;
  Vec3 start, along, normal;

  Vec3 at(double t) const { return start + along * t; }
  double depth(double t) const { return std::max(0.0, -first_inside(shape, at(t), normal)); }
  // Returns where the shape ends between a place below it and one beside it.
  double end(double inside, double beside) const {
    for (int k = 0; k < HALVINGS; ++k) {
      const double middle = 0.5 * (inside + beside);
      (depth(middle) > 0.0 ? inside : beside) = middle;
    }
    return inside;
  }
};

void sample_row(const Row& row, double width, std::vector<DepthSample>& samples) {
  constexpr double step = 1.0 / SIDE;
  int first = -1, last = -1;
  for (int k = 0; k < SIDE; ++k) {
    if (!(row.depth((k + 0.5) * step) > 0.0)) continue;
    if (first < 0) first = k;
    last = k;
  }
  if (first < 0) return;
  const double from = row.end((first + 0.5) * step, std::max(0.0, (first - 0.5) * step));
  const double to = row.end((last + 0.5) * step, std::min(1.0, (last + 1.5) * step));
  const double area = norm(row.along) * (to - from) * step * width;
  for (int k = 0; k < SIDE; ++k) {
    const double t = from + (to - from) * (k + 0.5) * step;
    samples.push_back({row.at(t), row.depth(t), area});
  }
}

// Finds samples of all that is below a plane of a shape, in the shape's frame: in 12 rows of 12, each as long as the
// shape is there.
void sample_below(const Convex& shape, const Plane& plane, std::vector<DepthSample>& samples) {
  samples.clear();
  const Rectangle around = around_part(shape, plane);
  if (around.empty()) return;
  const Vec3 along = around.along * (around.high[0] - around.low[0]);
  const double width = (around.high[1] - around.low[1]) / SIDE;
  const Vec3 corner = plane.normal * plane.offset + around.along * around.low[0] + around.across * around.low[1];
  for (int k = 0; k < SIDE; ++k)
    sample_row({shape, corner + around.across * ((k + 0.5) * width), along, plane.normal}, width, samples);
}

// The part of a shape below the plane of a contact, in the shape's frame. `moment` [m^4]: places weighted by their
// depths.
struct Pressed {
  double area = 0.0, volume = 0.0;
  Vec3 moment;
};

// Places of the contacts of a shape, in its frame.
struct Places {
  const Convex& shape;
  std::vector<Vec3> at;
  std::vector<DepthSample> samples;

  bool is_nearest(std::size_t k, const Vec3& p) const {
    const double own = norm2(p - at[k]);
    return std::none_of(at.begin(), at.end(), [&](const Vec3& other) { return norm2(p - other) < own; });
  }
  // Returns what contact k stands for, of the part below its plane after the shape `fell` [m].
  Pressed pressed(std::size_t k, const Vec3& normal, double fell) {
    Pressed found;
    sample_below(shape, {normal, dot(normal, at[k]) + fell}, samples);
    for (const DepthSample& sample : samples) {
      if (!is_nearest(k, sample.point)) continue;
      const double volume = sample.depth * sample.area;
      found.area += sample.area, found.volume += volume;
      found.moment = found.moment + sample.point * volume;
    }
    return found;
  }
};

}  // namespace

void lay_on_foundation(const Convex& shape, const Pose& pose, const Approach& approach, const BodySurface& body,
                       std::vector<Contact>& contacts, std::vector<ContactRow>& rows) {
  const double dt = approach.duration;
  Places places{shape, {}, {}};
  for (const Contact& contact : contacts) places.at.push_back(pose.to_local(contact.point));
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    Contact& contact = contacts[k];
    if (!contact.material.gives()) continue;
    const Vec3 normal = transposed(pose.rotation, contact.normal);
    double speed = dot(contact.normal, approach.velocity_at(contact));
    Pressed pressed = places.pressed(k, normal, -speed * dt);
    if (!(pressed.volume > 0.0)) {  // it leaves the ground, or it only comes there as gravity acts
      speed = contact.distance < 0.0 ? 0.0 : speed + dot(contact.normal, approach.gravity) * dt;
      pressed = places.pressed(k, normal, -speed * dt);
    }
    if (!(pressed.volume > 0.0)) continue;
    const double spring = contact.material.stiffness * pressed.area;
    const double share = body.is_soft ? body.stiffness / (body.stiffness + spring) : 1.0;  // of the depth in the ground
    const double damping = contact.material.damping * pressed.area + (body.is_soft ? body.damping : 0.0);
    const double force = share * contact.material.stiffness * pressed.volume, slope = share * spring * dt + damping;
    ContactRow& row = rows[k];
    const Vec3 at = pose.to_world(pressed.moment * (1.0 / pressed.volume) + normal * (speed * dt));
    const Vec3 differs = cross(contact.ground.angular, at - contact.point);  // velocity of the ground there
    const Vec3 turned = cross(approach.angular, row.at - contact.point);     // what the middle of the step differs by
    contact.ground.velocity = contact.ground.velocity + differs, row.slide = row.slide + differs - turned;
    row.at = contact.point = at, row.normal = contact.normal;
    row.speed = dot(contact.normal, contact.ground.velocity) + (force + share * spring * dt * speed) / slope;
    row.softness = std::max(1.0 / (dt * slope), norm2(body.belt) > 0.0 ? 1.0 / body.mass : 0.0);
  }
}

}  // namespace smartmesh
