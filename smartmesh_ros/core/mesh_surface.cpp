#include "mesh_surface.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Sine of the angle between two facets below which they are one plane.
constexpr double FLAT = 1e-5;
// Smallest barycentric weight inside a triangle; slightly negative, so that a point on an edge is in a triangle.
constexpr double INSIDE = -1e-12;
constexpr double NONE = std::numeric_limits<double>::quiet_NaN();

}  // namespace

// Reads vertices at one instant, and their rise within the time `ahead` [s].
class VertexReader {
 public:
  VertexReader(const MeshSurface& mesh, double time, double ahead = 0.0)
      : mesh_(mesh), phase_(block_phase(*mesh.clock, time, mesh.mode)), ahead_(ahead),
        still_(phase_.along == 0.0 && phase_.bend == 0.0) {}

  Vec3 position(int v) const {
    const Vec3& p = mesh_.points_[v];
    if (still_) return p;
    return p + Vec3{displacement(motion(0, v), phase_), displacement(motion(1, v), phase_),
                    displacement(motion(2, v), phase_)};
  }
  Vec3 rise(int v) const {
    return {rise_of(motion(0, v), phase_, ahead_), rise_of(motion(1, v), phase_, ahead_),
            rise_of(motion(2, v), phase_, ahead_)};
  }
  Motion motion(int axis, int v) const {
    if (mesh_.clock->known == 0) return {};
    const int newest = static_cast<int>(mesh_.clock->newest);
    return motion_of(velocity(newest, axis, v), velocity((newest + KEPT - 1) % KEPT, axis, v),
                     velocity((newest + KEPT - 2) % KEPT, axis, v), phase_, mesh_.max_velocity);
  }

 private:
  double velocity(int slot, int axis, int v) const {
    return mesh_.velocities[(static_cast<std::size_t>(slot) * 3 + axis) * mesh_.vertices + v];
  }

  const MeshSurface& mesh_;
  const Phase phase_;
  const double ahead_;
  const bool still_;
};

namespace {

// Adds the parts of one mesh to a patch.
class MeshAdder {
 public:
  MeshAdder(const MeshTopology& mesh, const VertexReader& reader, int number, const Reach& reach, MeshScratch& scratch,
            Patch& patch)
      : mesh_(mesh), reader_(reader), first_name_((static_cast<long>(number) + 1) << 40), reach_(reach),
        scratch_(scratch), patch_(patch) {}

  void run(const Bounds& bounds) {
    scratch_.edges.clear(), scratch_.peaks.clear();
    for (int f : scratch_.found) add_facet(f, bounds);
    for (int e : scratch_.edges) add_edge(mesh_.edges[e]);
    for (int v : scratch_.peaks) add_peak(v);
  }

 private:
  void add_facet(int f, const Bounds& bounds) {
    const auto& corner = mesh_.facets[f];
    const Vec3 a = reader_.position(corner[0]), b = reader_.position(corner[1]), c = reader_.position(corner[2]);
    Bounds box;
    box.add(a), box.add(b), box.add(c);
    const Vec3 normal = unit(cross(b - a, c - a));
    if (!box.meets(bounds) || !reach_.touches((box.low + box.high) * 0.5, 0.5 * norm(box.high - box.low))) return;
    if (!(norm2(normal) > 0.0)) return;  // vertices have come together
    patch_.facets.push_back({{point(corner[0]), point(corner[1]), point(corner[2])},
                             normal, std::max(norm(b - a), norm(c - a))});
    for (const int* e = mesh_.edges_of.begin(f); e != mesh_.edges_of.end(f); ++e) {
      if (scratch_.stamp_of_edge[*e] == scratch_.stamp) continue;
      scratch_.stamp_of_edge[*e] = scratch_.stamp;
      scratch_.edges.push_back(*e);
    }
  }

  int point(int v) {
    if (scratch_.stamp_of_vertex[v] != scratch_.stamp) {
      scratch_.stamp_of_vertex[v] = scratch_.stamp;
      scratch_.point_of[v] = static_cast<int>(patch_.points.size());
      patch_.points.push_back(reader_.position(v));
      patch_.names.push_back(first_name_ + v);
    }
    return scratch_.point_of[v];
  }

  // An edge is convex if all its facets lie within less than half a turn around it. It is then touched from directions
  // that the outermost two of them bound.
  void add_edge(const MeshEdge& edge) {
    const int a = point(edge.end[0]), b = point(edge.end[1]);
    const Vec3 from = patch_.points[a], to = patch_.points[b], along = unit(to - from);
    if (!reach_.touches((from + to) * 0.5, 0.5 * norm(to - from))) return;
    if (edge.count == 2 && !is_outside(edge, from, to)) return;
    Edge found{{a, b}, {-1, -1}, {}};
    if (!find_outermost(edge, from, along, found)) return;
    patch_.edges.push_back(found);
    for (int v : edge.end) {
      if (scratch_.stamp_of_peak[v] == scratch_.stamp) continue;
      scratch_.stamp_of_peak[v] = scratch_.stamp;
      scratch_.peaks.push_back(v);
    }
  }

  // Returns true if what touches may be outside an edge of two facets, on the side of one of them at least.
  bool is_outside(const MeshEdge& edge, const Vec3& from, const Vec3& to) {
    const Vec3 u = reader_.position(mesh_.opposite[edge.first]) - from;
    const Vec3 v = reader_.position(mesh_.opposite[edge.first + 1]) - from;
    Vec3 one = cross(to - from, u), other = -cross(to - from, v);
    if (dot(one, v) > 0.0) one = -one, other = -other;
    return reach_.is_outside(from, one, other);
  }

  bool find_outermost(const MeshEdge& edge, const Vec3& from, const Vec3& along, Edge& found) {
    Vec3 first, second;  // directions into the outermost facets, `second` counterclockwise of `first`
    for (int k = edge.first; k < edge.first + edge.count; ++k) {
      const int corner = point(mesh_.opposite[k]);
      const Vec3 away = patch_.points[corner] - from, into = unit(away - along * dot(away, along));
      if (k == edge.first) {
        first = second = into;
        found.opposite[0] = corner;
        continue;
      }
      const auto turn = [&](const Vec3& u, const Vec3& v) { return dot(cross(u, v), along); };
      const auto opposes = [&](const Vec3& u) { return dot(u, into) < 0.0 && std::abs(turn(u, into)) < FLAT; };
      if (opposes(first) || opposes(second)) return false;
      const bool left_of_first = turn(first, into) >= 0.0, left_of_second = turn(second, into) >= 0.0;
      if (left_of_first && !left_of_second) continue;  // between them
      if (!left_of_first && left_of_second) return false;  // behind both: they go all the way round
      if (left_of_first) second = into, found.opposite[1] = corner;
      else {
        if (found.opposite[1] < 0) found.opposite[1] = found.opposite[0];
        first = into, found.opposite[0] = corner;
      }
    }
    found.outward = -(first + second);
    return true;
  }

  void add_peak(int v) {
    const int at = point(v);
    if (!reach_.touches(patch_.points[at], 0.0)) return;
    Peak peak{at, static_cast<int>(patch_.neighbours.size()), 0};
    for (const int* k = mesh_.neighbours.begin(v); k != mesh_.neighbours.end(v); ++k, ++peak.count)
      patch_.neighbours.push_back(point(*k));
    patch_.peaks.push_back(peak);
  }

  const MeshTopology& mesh_;
  const VertexReader& reader_;
  const long first_name_;
  const Reach& reach_;
  MeshScratch& scratch_;
  Patch& patch_;
};

Bounds box_of(const MeshTopology& mesh, int f, const std::vector<Vec3>& points) {
  Bounds box;
  for (int k : mesh.facets[f]) box.add(points[k]);
  return box;
}

// Returns the rate of turning [rad/s] of a triangle with sides `u` and `v` that change by `du` and `dv` within `ahead`.
Vec3 turn_of(const Vec3& u, const Vec3& v, const Vec3& du, const Vec3& dv, double ahead) {
  const double length = norm(u);
  const Vec3 along = u * (1.0 / length), up = unit(cross(u, v)), across = cross(up, along);
  const double spin = dot(du, across) / length, pitch = -dot(du, up) / length;
  const double roll = (dot(dv, up) + dot(v, along) * pitch) / dot(v, across);
  return (along * roll + across * pitch + up * spin) * (1.0 / ahead);
}

}  // namespace

void MeshScratch::begin(std::size_t vertices, std::size_t edge_count) {
  if (point_of.size() < vertices)
    point_of.resize(vertices), stamp_of_vertex.resize(vertices, 0), stamp_of_peak.resize(vertices, 0);
  if (stamp_of_edge.size() < edge_count) stamp_of_edge.resize(edge_count, 0);
  ++stamp;
}

bool MeshSurface::moves(double time) const {
  return clock->known > 0 && goes_on(time, clock->time, clock->lifetime, clock->delay);
}

void MeshSurface::update() {
  ++revision;
  const std::size_t n = vertices;
  points_.resize(n);
  for (std::size_t v = 0; v < n; ++v) points_[v] = {now[v], now[n + v], now[2 * n + v]};
  const bool is_new = topology_.facets.empty();
  const bool parted = !is_new && !holds_together(topology_, points_);
  if (is_new || parted) topology_ = topology_of(points_, triangles, triangle_count);
  std::vector<Bounds> boxes;
  for (std::size_t f = 0; f < topology_.facets.size(); ++f)
    boxes.push_back(box_of(topology_, static_cast<int>(f), points_));
  if (is_new || parted) tree_.build(boxes);
  else tree_.refit(boxes);
  speed_ = acceleration_ = 0.0;
  if (clock->known == 0) return;
  const VertexReader reader(*this, clock->time);
  for (int v = 0; v < vertices; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const Motion motion = reader.motion(axis, v);
      speed_ = std::max(speed_, std::abs(motion.velocity));
      acceleration_ = std::max(acceleration_, std::abs(motion.acceleration));
    }
  }
}

double MeshSurface::drift(double time) const {
  const Phase phase = block_phase(*clock, time, mode);
  return speed_ * std::abs(phase.along) + acceleration_ * std::abs(phase.bend);
}

void MeshSurface::gather(const Bounds& bounds, double time, const Reach& reach, int number, MeshScratch& scratch,
                         Patch& patch) const {
  tree_.find(bounds.grown(drift(time)), scratch.found);
  if (scratch.found.empty()) return;
  scratch.begin(static_cast<std::size_t>(vertices), topology_.edges.size());
  MeshAdder(topology_, VertexReader(*this, time), number, reach, scratch, patch).run(bounds);
}

MeshPoint MeshSurface::below(double x, double y, double z, double time, double ahead) const {
  std::vector<int> found;
  const double drifted = drift(time);
  tree_.find(Bounds{{x, y, -1e300}, {x, y, z}}.grown(drifted), found);
  const VertexReader reader(*this, time, ahead);
  MeshPoint best{NONE, {}, {}};
  for (int f : found) {
    const auto& k = topology_.facets[f];
    const Vec3 a = reader.position(k[0]), b = reader.position(k[1]), c = reader.position(k[2]);
    const auto side = [&](const Vec3& p, const Vec3& q) { return (p.x - x) * (q.y - y) - (p.y - y) * (q.x - x); };
    double u = side(b, c), v = side(c, a), w = side(a, b);
    const double area = u + v + w;
    if (area == 0.0) continue;
    u /= area, v /= area, w /= area;
    if (!(u >= INSIDE && v >= INSIDE && w >= INSIDE)) continue;
    const double height = u * a.z + v * b.z + w * c.z;
    if (!(height <= z) || height <= best.height) continue;
    const Vec3 ra = reader.rise(k[0]), rb = reader.rise(k[1]), rc = reader.rise(k[2]);
    best = {height, (ra * u + rb * v + rc * w) * (1.0 / ahead), turn_of(b - a, c - a, rb - ra, rc - ra, ahead)};
  }
  return best;
}

}  // namespace smartmesh
