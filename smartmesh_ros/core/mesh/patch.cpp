#include "mesh/patch.h"

#include <algorithm>
#include <cmath>

#include "math/triangle.h"

namespace smartmesh {

namespace {

// Distance from a facet within which a point lies on it [m].
constexpr double NEAR = 1e-6;
// Least weight of a corner below which a point of a facet is on its edge.
constexpr double AT_EDGE = 1e-9;

}  // namespace

CellRange PatchCells::near(double x, double y, double half_x, double half_y) const {
  if (rows == 1 && columns == 1) return {0, 0, 1, 1};
  const GridPoint p = to_grid(pose, resolution, x, y);
  const double c = std::abs(pose.cos), s = std::abs(pose.sin), size = 1.0 / resolution;
  const double high = (half_y * c + half_x * s) * size, wide = (half_x * c + half_y * s) * size;
  const auto cell = [](double value, int count) {
    return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(count)));
  };
  return {cell(p.row - high, rows), cell(p.column - wide, columns), std::min(cell(p.row + high, rows) + 1, rows),
          std::min(cell(p.column + wide, columns) + 1, columns)};
}

void Patch::finish() {
  highest = -1e300;
  for (const Vec3& p : points) highest = std::max(highest, p.z);
  if (std::none_of(velocities.begin(), velocities.end(), [](const Vec3& v) { return norm2(v) > 0.0; }))
    velocities.clear();
  if (cells.rows != 0) return;
  cells.rows = cells.columns = 1;
  cells.facets = {0, static_cast<int>(facets.size())};
  cells.edges = {0, static_cast<int>(edges.size())};
  cells.peaks = {0, static_cast<int>(peaks.size())};
}

const Facet* Patch::nearest_facet(const Vec3& p, double (&shares)[3]) const {
  const Facet* nearest = nullptr;
  double least = 1e300, weights[3];
  const auto look = [&](int first, int end) {
    for (int f = first; f < end; ++f) {
      const auto& [k, normal, size] = facets[f];
      const double from_plane = dot(normal, p - points[k[0]]);
      if (from_plane * from_plane >= least) continue;
      const double distance2 = nearest_weights(p, points[k[0]], points[k[1]], points[k[2]], normal, weights);
      if (distance2 >= least) continue;
      least = distance2, nearest = &facets[f];
      std::copy(weights, weights + 3, shares);
    }
  };
  const CellRange here = cells.near(p.x, p.y, 0.0, 0.0);
  if (!here.empty()) look(cells.facets[cells.at(here.top, here.left)], cells.facets[cells.at(here.top, here.left) + 1]);
  if (least > NEAR * NEAR) look(0, static_cast<int>(facets.size()));
  return nearest;
}

Vec3 Patch::velocity_at(const Vec3& p) const {
  double shares[3];
  const Facet* nearest = velocities.empty() ? nullptr : nearest_facet(p, shares);
  if (nearest == nullptr) return {};
  const auto& k = nearest->corner;
  return velocities[k[0]] * shares[0] + velocities[k[1]] * shares[1] + velocities[k[2]] * shares[2];
}

Vec3 Patch::angular_velocity_at(const Vec3& p) const {
  double shares[3];
  const Facet* nearest = velocities.empty() ? nullptr : nearest_facet(p, shares);
  if (nearest == nullptr) return {};
  return std::min({shares[0], shares[1], shares[2]}) > AT_EDGE ? angular_velocity(*nearest)
                                                               : angular_velocity_around(p, *nearest);
}

Vec3 Patch::angular_velocity_around(const Vec3& p, const Facet& nearest) const {
  Vec3 sum;
  int count = 0;
  double weights[3];
  const CellRange near = cells.near(p.x, p.y, NEAR, NEAR);
  for (int r = near.top; r < near.bottom; ++r) {
    for (int f = cells.facets[cells.at(r, near.left)]; f < cells.facets[cells.at(r, near.right - 1) + 1]; ++f) {
      const auto& [k, normal, size] = facets[f];
      if (std::abs(dot(normal, p - points[k[0]])) > NEAR) continue;
      if (nearest_weights(p, points[k[0]], points[k[1]], points[k[2]], normal, weights) > NEAR * NEAR) continue;
      sum = sum + angular_velocity(facets[f]), ++count;
    }
  }
  return count > 0 ? sum * (1.0 / count) : angular_velocity(nearest);
}

Vec3 Patch::turn_of(const Edge& edge) const {
  const auto& [a, b] = edge.end;
  return velocities.empty() ? Vec3{} : (velocities[b] - velocities[a]) * (1.0 / norm(points[b] - points[a]));
}

Vec3 Patch::angular_velocity(const Facet& facet) const {
  const auto& k = facet.corner;
  const Vec3 u = points[k[1]] - points[k[0]], v = points[k[2]] - points[k[0]];
  const Vec3 du = velocities[k[1]] - velocities[k[0]], dv = velocities[k[2]] - velocities[k[0]];
  const double length = norm(u);
  const Vec3 along = u * (1.0 / length), across = cross(facet.normal, along);
  const double spin = dot(du, across) / length, pitch = -dot(du, facet.normal) / length;
  const double roll = (dot(dv, facet.normal) + dot(v, along) * pitch) / dot(v, across);
  return along * roll + across * pitch + facet.normal * spin;
}

}  // namespace smartmesh
