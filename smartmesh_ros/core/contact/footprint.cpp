#include "contact/footprint.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

constexpr double INFINITE = std::numeric_limits<double>::infinity();
// Rows, and samples in each.
constexpr int SIDE = 12;
// Halvings of a step between samples in which the end of a row is found.
constexpr int HALVINGS = 6;
// Slope of a plane across the axis of a cylinder, below which the cylinder stands upright on it.
constexpr double UPRIGHT = 1e-9;

// A rectangle in a plane, with its sides along two axes, that grows around points.
struct Rectangle {
  Vec3 along, across;
  double low[2] = {INFINITE, INFINITE}, high[2] = {-INFINITE, -INFINITE};

  // `level`: a direction in the plane or near it.
  Rectangle(const Vec3& normal, const Vec3& level)
      : along(unit(level - normal * dot(level, normal))), across(cross(normal, along)) {}
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

}  // namespace

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

}  // namespace smartmesh
