// Points and rays on a moving triangle mesh.

#include "mesh/mesh_reader.h"

namespace smartmesh {

namespace {

// Smallest barycentric weight inside a triangle; slightly negative, so that what meets an edge is in a triangle.
constexpr double INSIDE = -1e-12;
// Vertices that a point or a ray reads, about.
constexpr std::size_t VERTICES_READ = 8;
// Distance by which boxes are grown [m], so that rounding does not move a ray out of the flat box of a facet.
constexpr double ROUNDING = 1e-9;

}  // namespace

MeshReader::MeshReader(const MeshSurface& mesh, double time, double ahead)
    : mesh_(&mesh),
      phase_(block_phase(mesh.clock, time, mesh.mode)),
      blend_(mesh.blend(mesh.clock, time, ahead)),
      ahead_(ahead),
      age_(time - mesh.clock.time),
      drift_(mesh.drift(time)),
      still_(phase_.along == 0.0 && phase_.bend == 0.0 && blend_.offset == 0.0),
      velocities_(mesh.velocities.data(), 3 * static_cast<std::size_t>(mesh.vertices), mesh.clock) {}

void MeshReader::prepare(std::size_t count) {
  if (!positions_.empty() || VERTICES_READ * count < static_cast<std::size_t>(mesh_->vertices)) return;
  std::vector<Vec3> positions, displacements;
  positions.reserve(static_cast<std::size_t>(mesh_->vertices)), displacements.reserve(positions.capacity());
  for (int v = 0; v < mesh_->vertices; ++v) {
    const Vertex vertex = read(v);
    positions.push_back(vertex.position), displacements.push_back(vertex.displacement);
  }
  positions_.swap(positions), displacements_.swap(displacements);
}

// The test of a ray and a triangle is that of Moeller and Trumbore (*Fast, Minimum Storage Ray/Triangle Intersection*,
// 1997).
RayHit MeshReader::first_hit(const Vec3& from, const Vec3& way, double range) const {
  const auto distance_to = [&](int facet) {
    const auto& k = mesh_->topology_.facets[facet];
    const Vec3 a = position(k[0]), p = position(k[1]) - a, q = position(k[2]) - a;
    const Vec3 h = cross(way, q), s = from - a;
    const double determinant = dot(p, h);
    if (determinant == 0.0) return INFINITE;
    const Vec3 t = cross(s, p);
    const double u = dot(s, h) / determinant, v = dot(way, t) / determinant;
    if (!(u >= INSIDE && v >= INSIDE && u + v <= 1.0 - INSIDE)) return INFINITE;
    const double found = dot(q, t) / determinant;
    return found >= 0.0 ? found : INFINITE;
  };
  const BoxHit hit = mesh_->tree_.first_along(from, way, range, drift_ + ROUNDING, distance_to);
  if (hit.place < 0) return {};
  const auto& k = mesh_->topology_.facets[hit.place];
  const Vec3 a = position(k[0]);
  return {hit.distance, unit(cross(position(k[1]) - a, position(k[2]) - a))};
}

GroundSample MeshReader::below(double x, double y, double z) {
  mesh_->tree_.find(Bounds{{x, y, -1e300}, {x, y, z}}.grown(drift_), found_);
  int best = -1;
  double height = 0.0, weights[3] = {};
  for (int f : found_) {
    const auto& k = mesh_->topology_.facets[f];
    const Vec3 a = position(k[0]), b = position(k[1]), c = position(k[2]);
    const auto side = [&](const Vec3& p, const Vec3& q) { return (p.x - x) * (q.y - y) - (p.y - y) * (q.x - x); };
    double u = side(b, c), v = side(c, a), w = side(a, b);
    const double area = u + v + w;
    if (area == 0.0) continue;
    u /= area, v /= area, w /= area;
    if (!(u >= INSIDE && v >= INSIDE && w >= INSIDE)) continue;
    const double found = u * a.z + v * b.z + w * c.z;
    if (!(found <= z) || (best >= 0 && found <= height)) continue;
    best = f, height = found;
    weights[0] = u, weights[1] = v, weights[2] = w;
  }
  if (best < 0) return {};
  const auto& k = mesh_->topology_.facets[best];
  const Vec3 a = position(k[0]), normal = unit(cross(position(k[1]) - a, position(k[2]) - a));
  const Vec3 moved =
      displacement_of(k[0]) * weights[0] + displacement_of(k[1]) * weights[1] + displacement_of(k[2]) * weights[2];
  return {{height, moved * (1.0 / ahead_)}, normal, age_, Material{}.friction, true};
}

}  // namespace smartmesh
