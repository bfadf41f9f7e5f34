#include "soil/soil_shape.h"

namespace smartmesh {

namespace {

const double SQRT2 = std::sqrt(2.0);
// Rise of an axis above which a cylinder stands.
constexpr double STANDS = 0.7;
// Slope below which a face counts as vertical.
constexpr double LEVEL = 1e-9;

// Returns how much the faces across each axis face the ground: as they do its normal, and as they look down. A face
// that does but one of these is no sole. The sum of all three is the vertical component of the normal.
Vec3 facing(const Vec3& normal, const Vec3 (&axis)[3]) {
  return {dot(normal, axis[0]) * axis[0].z, dot(normal, axis[1]) * axis[1].z, dot(normal, axis[2]) * axis[2].z};
}

// Returns the axis whose face is on the ground; a cylinder stands on its flat end if that faces it more than its rim.
int sole_of(ShapeKind kind, const Vec3& faces, double all) {
  if (kind == ShapeKind::Cylinder ? 2.0 * faces.z >= all : faces.z >= faces.x && faces.z >= faces.y) return 2;
  return faces.x >= faces.y ? 0 : 1;
}

// By value, so that loops over rows become instructions on two numbers.
inline double least(double a, double b) { return b < a ? b : a; }
inline double most(double a, double b) { return a < b ? b : a; }

double under_sphere(double radius, double x, double y) {
  const double left = radius * radius - x * x - y * y;
  return left > 0.0 ? -std::sqrt(left) : INFINITE;
}

// A vertical line is in a convex shape where it is inside of all its surfaces: from `low` to `high`, nowhere if these
// cross. Cuts that part by the pair of faces across an axis that are `half` from the middle [m].
void cut_by_faces(const Underside& shape, int axis, double half, UndersideRow& row) {
  const double along_x = shape.axis(axis).x, rest = shape.axis(axis).y * row.y, slope = shape.axis(axis).z;
  const double* x = row.x.data();
  double *low = row.low.data(), *high = row.high.data();
  const std::size_t count = row.x.size();
  if (std::abs(slope) < LEVEL) {
    for (std::size_t k = 0; k < count; ++k) low[k] = std::abs(along_x * x[k] + rest) <= half ? low[k] : INFINITE;
    return;
  }
  for (std::size_t k = 0; k < count; ++k) {
    const double start = along_x * x[k] + rest, a = (-half - start) / slope, b = (half - start) / slope;
    low[k] = most(low[k], least(a, b));
    high[k] = least(high[k], most(a, b));
  }
}

// Cuts by the round surface about axis 2.
void cut_by_round(const Underside& shape, double radius, UndersideRow& row) {
  const Vec3 u = shape.axis(0), v = shape.axis(1);
  const double y = row.y, a = u.z * u.z + v.z * v.z;
  const double* x = row.x.data();
  double *low = row.low.data(), *high = row.high.data();
  if (a < 1e-12) {  // it stands upright
    for (std::size_t k = 0; k < row.x.size(); ++k) {
      const double px = u.x * x[k] + u.y * y, py = v.x * x[k] + v.y * y;
      low[k] = px * px + py * py - radius * radius <= 0.0 ? low[k] : INFINITE;
    }
    return;
  }
  for (std::size_t k = 0, count = row.x.size(); k < count; ++k) {
    const double px = u.x * x[k] + u.y * y, py = v.x * x[k] + v.y * y;
    const double b = px * u.z + py * v.z, c = px * px + py * py - radius * radius, left = b * b - a * c;
    const double root = std::sqrt(most(left, 0.0)), first = (-b - root) / a, last = (-b + root) / a;
    low[k] = left > 0.0 ? most(low[k], first) : INFINITE;
    high[k] = least(high[k], last);
  }
}

void leave_out_crossed(UndersideRow& row) {
  for (std::size_t k = 0; k < row.x.size(); ++k) row.low[k] = row.low[k] <= row.high[k] ? row.low[k] : INFINITE;
}

// Writes the shares of a row that a standing cylinder covers.
void cover_round(const Underside& shape, UndersideRow& row) {
  for (std::size_t k = 0; k < row.x.size(); ++k) {
    const double inside = shape.half[0] - std::hypot(row.x[k] - shape.lowest.x, row.y - shape.lowest.y);
    row.share[k] = std::min(std::max(0.5 + inside / shape.spacing, 0.0), 1.0);
  }
}

// Multiplies the shares of a row by those of what faces the ground along one of the axes, seen from above.
void cover_along(const Underside& shape, int axis, UndersideRow& row) {
  const double along_x = shape.across[axis].x, rest = shape.across[axis].y * row.y;
  const double from = shape.from[axis], to = shape.to[axis], spacing = shape.spacing, half_cell = 0.5 * spacing;
  const double* x = row.x.data();
  double* share = row.share.data();
  for (std::size_t k = 0, count = row.x.size(); k < count; ++k) {
    const double distance = along_x * x[k] + rest;
    const double left = most(distance - half_cell, from), right = least(distance + half_cell, to);
    share[k] *= most(right - left, 0.0) / spacing;
  }
}

}  // namespace

Underside underside(const Solid& solid, double spacing, const Vec3& normal) {
  const Shape& own = *solid.shape;
  const Vec3 faces = facing(normal, solid.axes.row);
  const int sole = sole_of(own.kind, faces, normal.z);
  const Vec3& up = solid.axes.row[sole];
  const double cosine = most(std::abs(up.z), std::abs(dot(normal, up)));
  const bool is_level = (own.kind == ShapeKind::Box || sole == 2) && 1.0 - cosine * cosine < STEEP * STEEP;
  Underside shape{solid, own.kind, {own.half.x, own.half.y, own.half.z}, spacing, sole, is_level};
  const bool is_cylinder = own.kind == ShapeKind::Cylinder, stands = shape.upright == 2;
  for (int k = 0; k < 3; ++k) {
    const Vec3& axis = shape.axis(k);
    if (k < 2) shape.half[k] += own.rounding;
    shape.margin[k] = spacing * (std::abs(axis.x) + std::abs(axis.y));
    shape.grown[k] = shape.half[k];
    if (own.kind == ShapeKind::Box && k != shape.upright) shape.grown[k] += shape.margin[k];
    if (is_cylinder && stands && k < 2) shape.grown[k] += SQRT2 * spacing;
    if (is_cylinder && !stands && k == 2) shape.grown[k] += shape.margin[k];
  }
  Vec3 down = shape.axis(shape.upright) * std::copysign(1.0, -dot(normal, shape.axis(shape.upright)));
  if (is_cylinder && !stands) down = unit(dot(normal, shape.axis(2)) * shape.axis(2) - normal);
  shape.lowest = down * shape.half[is_cylinder && !stands ? 0 : shape.upright];
  const double below = is_cylinder && !stands ? normal.z - faces.z : component(faces, shape.upright);
  for (int k = 0; k < 3; ++k) {
    const Vec3& axis = shape.axis(k);
    const double level = std::sqrt(axis.x * axis.x + axis.y * axis.y), half = shape.half[k] * level;
    if (level < LEVEL) continue;  // it stands upright
    shape.across[k] = Vec3{axis.x, axis.y, 0.0} * (1.0 / level);
    const double middle = dot(shape.lowest, shape.across[k]), seen = solid.extent_along(shape.across[k]);
    const double beside = std::min(std::max(component(faces, k) / below, 0.0), 1.0);
    shape.from[k] = middle - half + beside * (half - middle - seen);
    shape.to[k] = middle + half + beside * (seen - half - middle);
  }
  return shape;
}

void look_up(const Underside& shape, UndersideRow& row) {
  const std::size_t count = row.x.size();
  row.low.assign(count, -INFINITE), row.high.assign(count, INFINITE);
  if (shape.kind == ShapeKind::Ball) {
    for (std::size_t k = 0; k < count; ++k) row.low[k] = under_sphere(shape.half[0], row.x[k], row.y);
    return;
  }
  const bool is_box = shape.kind == ShapeKind::Box;
  for (int k = is_box ? 0 : 2; k < 3; ++k) cut_by_faces(shape, k, shape.grown[k], row);
  if (!is_box) cut_by_round(shape, shape.grown[0], row);
  leave_out_crossed(row);
  if (shape.kind != ShapeKind::Capsule) return;
  for (const double side : {-shape.half[2], shape.half[2]}) {
    const Vec3 end = shape.axis(2) * side;
    for (std::size_t k = 0; k < count; ++k)
      row.low[k] = std::min(row.low[k], end.z + under_sphere(shape.half[0], row.x[k] - end.x, row.y - end.y));
  }
}

void look_up_exact(const Underside& shape, const UndersideRow& row, UndersideRow& exact) {
  exact.y = row.y, exact.x = row.x, exact.low = row.low, exact.high = row.high;
  const bool is_box = shape.kind == ShapeKind::Box;
  if (!is_box && shape.kind != ShapeKind::Cylinder) return;  // without flat faces
  for (int k = is_box ? 0 : 2; k < 3; ++k)
    if (shape.half[k] < shape.grown[k]) cut_by_faces(shape, k, shape.half[k], exact);
  if (!is_box && shape.half[0] < shape.grown[0]) cut_by_round(shape, shape.half[0], exact);
  leave_out_crossed(exact);
}

void cover(const Underside& shape, UndersideRow& row) {
  row.share.assign(row.x.size(), 1.0);
  const bool is_box = shape.kind == ShapeKind::Box, is_cylinder = shape.kind == ShapeKind::Cylinder;
  if (is_cylinder && shape.upright == 2)
    cover_round(shape, row);
  else if (is_cylinder)
    cover_along(shape, 2, row);
  for (int k = 0; k < 3; ++k)
    if (is_box && k != shape.upright) cover_along(shape, k, row);
}

Vec3 normal_at(const Underside& shape, const double (&half)[3], const Vec3& point) {
  if (shape.kind == ShapeKind::Box) {
    int face = 0;
    double farthest = -1.0;
    for (int k = 0; k < 3; ++k) {
      const double out = std::abs(dot(shape.axis(k), point)) / half[k];
      if (out > farthest) face = k, farthest = out;
    }
    return shape.axis(face);
  }
  const Vec3& axis = shape.axis(2);
  double along = shape.kind == ShapeKind::Ball ? 0.0 : dot(axis, point);
  if (shape.kind == ShapeKind::Cylinder && std::abs(along) > (1.0 - 1e-6) * half[2]) return axis;  // a flat end
  if (shape.kind == ShapeKind::Capsule) along = std::min(std::max(along, -shape.half[2]), shape.half[2]);
  const Vec3 out = point - along * axis;
  const double length = norm(out);
  return {out.x / length, out.y / length, out.z / length};
}

double contact_width(const Underside& shape) {
  const double* half = shape.half;
  if (shape.kind == ShapeKind::Box) return 2.0 * std::min(half[(shape.upright + 1) % 3], half[(shape.upright + 2) % 3]);
  if (shape.kind == ShapeKind::Cylinder) return shape.upright == 2 ? half[0] : 2.0 * half[2];
  return half[0];
}

double half_extent(const Underside& shape, int along) {
  const double half = shape.solid.extent_along(along == 0 ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0});
  if (shape.kind == ShapeKind::Cylinder && shape.upright == 2) return half + SQRT2 * shape.spacing;
  if (shape.kind == ShapeKind::Cylinder) return half + shape.spacing * 2.0 * std::abs(component(shape.axis(2), along));
  double found = half;
  if (shape.kind == ShapeKind::Box)
    for (int k = 0; k < 3; ++k)
      if (k != shape.upright) found += shape.margin[k] * std::abs(component(shape.axis(k), along));
  return found;
}

bool lies(const Solid& solid) {
  const ShapeKind kind = solid.shape->kind;
  return (kind == ShapeKind::Cylinder || kind == ShapeKind::Capsule) && std::abs(solid.axes.row[2].z) < STANDS;
}

std::pair<double, double> half_extents_below(const Underside& shape, double below) {
  const double x = half_extent(shape, 0), y = half_extent(shape, 1), radius = shape.half[0];
  const bool is_ball = shape.kind == ShapeKind::Ball;
  if (!is_ball && !lies(shape.solid)) return {x, y};
  const Vec3 axis = is_ball ? Vec3{} : shape.axis(2);
  const double deep = below + (is_ball ? 0.0 : std::abs(axis.z) * (shape.half[2] + radius));
  const double half = deep >= 0.0 ? radius : std::sqrt(std::max(0.0, radius * radius - deep * deep));
  if (is_ball) return {half, half};
  const double level = std::hypot(axis.x, axis.y),
               end = shape.grown[2] + (shape.kind == ShapeKind::Capsule ? radius : 0.0);
  return {std::min(x, std::abs(axis.x) * end + half * std::abs(axis.y) / level + radius * std::abs(axis.z)),
          std::min(y, std::abs(axis.y) * end + half * std::abs(axis.x) / level + radius * std::abs(axis.z))};
}

}  // namespace smartmesh
