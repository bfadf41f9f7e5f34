#include "mesh/mesh_surface.h"

#include <algorithm>
#include <cmath>

#include "mesh/mesh_reader.h"

namespace smartmesh {

namespace {

// Sine of the angle between two facets below which they are one plane.
constexpr double FLAT = 1e-5;

// Adds the parts of one mesh to a patch.
class MeshAdder {
 public:
  MeshAdder(const MeshTopology& mesh, const MeshReader& reader, int number, const Reach& reach, MeshScratch& scratch,
            Patch& patch)
      : mesh_(mesh),
        reader_(reader),
        first_name_((static_cast<long>(number) + 1) << MESHES_NAMED),
        reach_(reach),
        scratch_(scratch),
        patch_(patch) {}

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
    patch_.facets.push_back(
        {{point(corner[0]), point(corner[1]), point(corner[2])}, normal, std::max(norm(b - a), norm(c - a))});
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
      if (reader_.ahead() > 0.0) patch_.velocities.push_back(reader_.displacement_of(v) * (1.0 / reader_.ahead()));
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
      const Vec3 away = patch_.points[corner] - from, into = unit(perpendicular(away, along));
      if (k == edge.first) {
        first = second = into;
        found.opposite[0] = corner;
        continue;
      }
      const auto sine = [&](const Vec3& u, const Vec3& v) { return dot(cross(u, v), along); };
      const auto opposes = [&](const Vec3& u) { return dot(u, into) < 0.0 && std::abs(sine(u, into)) < FLAT; };
      if (opposes(first) || opposes(second)) return false;
      const bool left_of_first = sine(first, into) >= 0.0, left_of_second = sine(second, into) >= 0.0;
      if (left_of_first && !left_of_second) continue;      // between them
      if (!left_of_first && left_of_second) return false;  // behind both: they go all the way round
      if (left_of_first)
        second = into, found.opposite[1] = corner;
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
  const MeshReader& reader_;
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

}  // namespace

void MeshScratch::begin(std::size_t vertices, std::size_t edge_count) {
  if (point_of.size() < vertices)
    point_of.resize(vertices), stamp_of_vertex.resize(vertices, 0), stamp_of_peak.resize(vertices, 0);
  if (stamp_of_edge.size() < edge_count) stamp_of_edge.resize(edge_count, 0);
  ++stamp;
}

MeshSurface::MeshSurface(const double* positions, int count, const std::int64_t* corners, int of_corners)
    : vertices(count),
      triangle_count(of_corners),
      triangles(corners),
      now(positions, positions + 3 * static_cast<std::size_t>(count)),
      velocities(KEPT * now.size()),
      offsets(now.size()),
      rates(now.size()) {
  update();
}

bool MeshSurface::moves(double time) const { return may_move(clock, time, mode); }

void MeshSurface::update() {
  revision = next_revision();
  const std::size_t n = vertices;
  points_.resize(n);
  for (std::size_t v = 0; v < n; ++v) points_[v] = {now[v], now[n + v], now[2 * n + v]};
  const bool is_new = topology_.facets.empty();
  const bool parted = !is_new && !holds_together(topology_, points_);
  if (is_new || parted) topology_ = topology_of(points_, triangles, triangle_count);
  std::vector<Bounds> boxes;
  for (std::size_t f = 0; f < topology_.facets.size(); ++f)
    boxes.push_back(box_of(topology_, static_cast<int>(f), points_));
  if (is_new || parted)
    tree_.build(boxes);
  else
    tree_.refit(boxes);
  measure();
}

void MeshSurface::measure() {
  speed_ = acceleration_ = offset_ = rate_ = 0.0;
  if (clock.known == 0) return;
  const MeshReader reader(*this, clock.time, 0.0);
  for (int v = 0; v < vertices; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      const Motion motion = reader.motion(axis, v);
      speed_ = std::max(speed_, std::abs(motion.velocity));
      acceleration_ = std::max(acceleration_, std::abs(motion.acceleration));
      const std::size_t i = static_cast<std::size_t>(axis) * vertices + v;
      offset_ = std::max(offset_, std::abs(offsets.data()[i])), rate_ = std::max(rate_, std::abs(rates.data()[i]));
    }
  }
}

double MeshSurface::drift(double time) const {
  const Phase phase = block_phase(clock, time, mode);
  const Blend blend = MotionRules::blend(clock, time, 0.0);
  return speed_ * std::abs(phase.along) + acceleration_ * std::abs(phase.bend) + offset_ * blend.offset +
         rate_ * blend.rate;
}

void MeshSurface::gather(const Bounds& bounds, double time, double ahead, const Reach& reach, int number,
                         MeshScratch& scratch, Patch& patch) const {
  tree_.find(bounds.grown(drift(time)), scratch.found);
  if (scratch.found.empty()) return;
  scratch.begin(static_cast<std::size_t>(vertices), topology_.edges.size());
  MeshAdder(topology_, MeshReader(*this, time, ahead), number, reach, scratch, patch).run(bounds);
}

void MeshSurface::add_velocities(const Bounds& bounds, double time, double ahead, MeshScratch& scratch,
                                 Bounds& speeds) const {
  const MeshReader reader(*this, time, ahead);
  tree_.find(bounds.grown(drift(time) + drift(time + ahead)), scratch.found);
  for (int f : scratch.found)
    for (int v : topology_.facets[f]) speeds.add(reader.displacement_of(v) * (1.0 / ahead));
}

}  // namespace smartmesh
