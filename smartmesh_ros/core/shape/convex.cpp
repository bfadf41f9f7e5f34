#include "shape/convex.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "math/triangle.h"

namespace smartmesh {

namespace {

// Angle between the normals of two faces below which they count as one plane [rad].
constexpr double SAME_PLANE = 1e-4;
// Distance up to which points count as one, in one plane or on one line, as a share of a hull's size. Above the
// rounding of meshes in single precision, below what contacts notice.
constexpr double SAME = 1e-6;
// The part of a line p + t u that is inside a shape: from `first` to `last`, nowhere if these cross.
struct LineInside {
  Vec3 p, u;
  double first = -INFINITE, last = INFINITE;

  bool is_somewhere() const { return first <= last && last > -INFINITE; }
  void clip(const Vec3& normal, double offset) {
    const double start = dot(normal, p) - offset, change = dot(normal, u);
    if (change < 0.0)
      first = std::max(first, -start / change);
    else if (change > 0.0)
      last = std::min(last, -start / change);
    else if (start > 0.0)
      last = -INFINITE;
  }
  // Clips by the faces of a core that are moved outwards, or by a cylinder, also that of a capsule.
  void clip(const Convex& shape, double moved) {
    for (const PolyFace& face : shape.core.faces) clip(face.normal, face.offset + moved);
    if (shape.kind != ShapeKind::Cylinder && shape.kind != ShapeKind::Capsule) return;
    clip({0.0, 0.0, 1.0}, shape.half.z), clip({0.0, 0.0, -1.0}, shape.half.z);
    cut({}, shape.half.x + shape.rounding, true);
  }

  // Cuts by a ball around `centre`; with `level` by the cylinder about z through it.
  void cut(const Vec3& centre, double radius, bool level) {
    Vec3 w = p - centre, v = u;
    if (level) w.z = v.z = 0.0;
    const double vv = norm2(v), vw = dot(v, w), outside = norm2(w) - radius * radius, root = vw * vw - vv * outside;
    if (vv == 0.0 ? outside > 0.0 : root < 0.0) {
      last = -INFINITE;
    } else if (vv > 0.0) {
      first = std::max(first, (-vw - std::sqrt(root)) / vv), last = std::min(last, (-vw + std::sqrt(root)) / vv);
    }
  }
};

std::vector<Vec3> without_doubles(std::vector<Vec3> points, double tolerance) {
  std::sort(points.begin(), points.end(), [](const Vec3& a, const Vec3& b) { return a.x < b.x; });
  std::vector<Vec3> found;
  for (const Vec3& point : points) {
    bool is_new = true;
    for (auto k = found.rbegin(); is_new && k != found.rend() && point.x - k->x <= tolerance; ++k)
      is_new = norm2(point - *k) > tolerance * tolerance;
    if (is_new) found.push_back(point);
  }
  return found;
}

// Returns a shape with the features of its core, or a cylinder.
Convex with_features(ShapeKind kind, const Vec3& half, double rounding, const Polytope& core) {
  Convex shape;
  shape.kind = kind, shape.half = half, shape.rounding = rounding, shape.core = core;
  if (kind == ShapeKind::Cylinder) {
    shape.bounds = {-half, half};
    shape.bounding_radius = std::hypot(half.x, half.z);
  }
  shape.core.neighbours.resize(core.vertices.size());
  for (const PolyEdge& edge : core.edges) {
    shape.core.neighbours[edge.end[0]].push_back(edge.end[1]);
    shape.core.neighbours[edge.end[1]].push_back(edge.end[0]);
  }
  for (const Vec3& corner : core.vertices) {
    shape.bounds.add(corner);
    shape.centre = shape.centre + corner * (1.0 / static_cast<double>(core.vertices.size()));
    shape.bounding_radius = std::max(shape.bounding_radius, norm(corner) + rounding);
  }
  shape.bounds = shape.bounds.grown(rounding);
  return shape;
}

// Returns the vector area of a loop, whose direction is the normal of its face.
Vec3 area_of(const std::vector<Vec3>& corners, const std::vector<int>& loop) {
  Vec3 area;
  for (std::size_t k = 1; k + 1 < loop.size(); ++k)
    area = area + cross(corners[loop[k]] - corners[loop[0]], corners[loop[k + 1]] - corners[loop[0]]);
  return area;
}

// Takes the corners of all loops, and numbers them anew. Points without a face are the ends of a segment, or one point.
void add_corners(Polytope& core, const std::vector<Vec3>& corners, std::vector<std::vector<int>>& loops) {
  if (loops.empty()) {
    const auto lower = [&](const Vec3& a, const Vec3& b) { return norm2(a - corners[0]) < norm2(b - corners[0]); };
    const Vec3 one = *std::max_element(corners.begin(), corners.end(), lower);
    Vec3 other = one;
    for (const Vec3& corner : corners)
      if (norm2(corner - one) > norm2(other - one)) other = corner;
    core.vertices = {one};
    if (norm2(other - one) == 0.0) return;
    core.vertices.push_back(other);
    core.edges = {{{0, 1}, {-1, -1}, {}}};
    return;
  }
  std::vector<int> place(corners.size(), -1);
  for (auto& loop : loops) {
    for (int& k : loop) {
      if (place[k] < 0) place[k] = static_cast<int>(core.vertices.size()), core.vertices.push_back(corners[k]);
      k = place[k];
    }
  }
}

void add_faces(Polytope& core, const std::vector<std::vector<int>>& loops) {
  for (const auto& loop : loops) {
    const Vec3 area = area_of(core.vertices, loop);
    if (!(norm(area) > 0.0)) continue;
    const Vec3 normal = unit(area);
    core.faces.push_back({normal, dot(normal, core.vertices[loop[0]]), static_cast<int>(core.loops.size()),
                          static_cast<int>(loop.size())});
    core.loops.insert(core.loops.end(), loop.begin(), loop.end());
  }
}

void add_edges(Polytope& core) {
  std::map<std::pair<int, int>, int> found;  // by the ends, the lower first
  for (std::size_t f = 0; f < core.faces.size(); ++f) {
    const PolyFace& face = core.faces[f];
    for (int k = 0; k < face.count; ++k) {
      const int a = core.loops[face.first + k], b = core.loops[face.first + (k + 1) % face.count];
      const auto [place, is_new] = found.try_emplace({std::min(a, b), std::max(a, b)}, core.edges.size());
      if (is_new) core.edges.push_back({{a, b}, {-1, -1}, {}});
      PolyEdge& edge = core.edges[place->second];
      const int side = is_new ? 0 : 1;
      edge.faces[side] = static_cast<int>(f);
      edge.into[side] = unit(cross(face.normal, core.vertices[b] - core.vertices[a]));
      if (!is_new) edge.half_cosine = 0.5 * norm(core.faces[edge.faces[0]].normal + face.normal);
    }
  }
  const auto flat = [&](const PolyEdge& edge) {
    return edge.faces[1] < 0 || norm(core.faces[edge.faces[0]].normal - core.faces[edge.faces[1]].normal) < SAME_PLANE;
  };
  core.edges.erase(std::remove_if(core.edges.begin(), core.edges.end(), flat), core.edges.end());
}

// Returns a polytope from its corners and the loops of its faces, counterclockwise seen from outside. Faces of a loop
// without area are left out, and edges between faces in one plane.
Polytope polytope(const std::vector<Vec3>& corners, std::vector<std::vector<int>> loops) {
  Polytope core;
  add_corners(core, corners, loops);
  add_faces(core, loops);
  if (!loops.empty()) add_edges(core);
  return core;
}

}  // namespace

double lowest(const Convex& shape, const Vec3& n) {
  if (shape.kind != ShapeKind::Hull) return -shape.extent(n);
  double least = 1e300;
  for (const Vec3& corner : shape.core.vertices) least = std::min(least, dot(n, corner));
  return least - shape.rounding;
}

bool is_passed(const Convex& shape, const Vec3& p, const Vec3& q) {
  LineInside part{p, q - p, 0.0, 1.0};
  part.clip(shape, 0.0);
  return part.is_somewhere();
}

double first_inside(const Convex& shape, const Vec3& p, const Vec3& u) {
  const LineInside all{p, u};
  double first = INFINITE;
  const auto join = [&](const LineInside& part) {
    if (part.is_somewhere()) first = std::min(first, part.first);
  };
  if (!shape.core.faces.empty() || shape.kind == ShapeKind::Cylinder || shape.kind == ShapeKind::Capsule) {
    LineInside part = all;
    part.clip(shape, shape.rounding);
    join(part);
  }
  if (shape.core.faces.empty() && shape.rounding > 0.0) {  // the ends of balls and capsules
    for (const Vec3& end : shape.core.vertices) {
      LineInside part = all;
      part.cut(end, shape.rounding, false);
      join(part);
    }
  }
  return first;
}

// The nearest point is on a face that is seen from outside.
double distance_outside(const Polytope& hull, const Vec3& p) {
  const bool is_solid = hull.faces.size() > 2;
  double least = INFINITE, weights[3];
  for (const PolyFace& face : hull.faces) {
    if (is_solid && dot(face.normal, p) <= face.offset) continue;
    const auto corner = [&](int k) { return hull.vertices[hull.loops[face.first + k]]; };
    for (int k = 1; k + 1 < face.count; ++k)
      least = std::min(least, nearest_weights(p, corner(0), corner(k), corner(k + 1), face.normal, weights));
  }
  if (is_solid) return std::isinf(least) ? 0.0 : std::sqrt(least);
  for (const Vec3& vertex : hull.vertices) least = std::min(least, norm2(p - vertex));
  for (const PolyEdge& edge : hull.edges) {
    const Vec3 &a = hull.vertices[edge.end[0]], &b = hull.vertices[edge.end[1]];
    least = std::min(least, norm2(a + (b - a) * std::clamp(along_segment(p, a, b), 0.0, 1.0) - p));
  }
  return std::sqrt(least);
}

Convex ball(double radius) {
  Polytope core;
  core.vertices = {{}};
  return with_features(ShapeKind::Ball, {}, radius, core);
}

Convex capsule(double radius, double half) {
  Polytope core;
  core.vertices = {{0.0, 0.0, -half}, {0.0, 0.0, half}};
  core.edges = {{{0, 1}, {-1, -1}, {}}};
  return with_features(ShapeKind::Capsule, {0.0, 0.0, half}, radius, core);
}

Convex cylinder(double radius, double half) {
  return with_features(ShapeKind::Cylinder, {radius, radius, half}, 0.0, {});
}

Convex box(const Vec3& half) {
  std::vector<Vec3> corners;
  for (int k = 0; k < 8; ++k)
    corners.push_back({k & 1 ? half.x : -half.x, k & 2 ? half.y : -half.y, k & 4 ? half.z : -half.z});
  const Polytope core =
      polytope(corners, {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}});
  return with_features(ShapeKind::Box, half, 0.0, core);
}

Convex hull(const std::vector<Vec3>& points, double margin) {
  Bounds bounds;
  for (const Vec3& point : points) bounds.add(point);
  const double tolerance = SAME * norm(bounds.high - bounds.low);
  const std::vector<Vec3> corners = without_doubles(points, tolerance);
  return with_features(ShapeKind::Hull, {}, margin, polytope(corners, hull_faces(corners, tolerance)));
}

}  // namespace smartmesh
