#include "foot.h"

#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

// Weight of a triangle's distance to the centre of the body in the choice of the nearest one [-]; breaks ties between
// gaps.
constexpr double TIE = 1e-6;

// The nearest of the triangles that were tried, and its number.
struct Nearest {
  const BodySolid& body;
  double rank = std::numeric_limits<double>::infinity();
  Gap gap{rank, {}};
  Triangle triangle;
  std::size_t number = 0;

  explicit Nearest(const BodySolid& of) : body(of) {}

  void try_one(const Triangle& triangle_, std::size_t number_) {
    const Gap found = gap_between(triangle_, body, rank);
    const double found_rank = found.distance + TIE * norm(found.nearest - body.whole.centre);
    if (found_rank < rank) rank = found_rank, gap = found, triangle = triangle_, number = number_;
  }
  Vec3 normal() const { return unit(cross(triangle.b - triangle.a, triangle.c - triangle.a)); }
};

void write(const Vec3& v, double* out) { out[0] = v.x, out[1] = v.y, out[2] = v.z; }

// Corners of the facet below (0) or above (1) the diagonal of a cell, as steps in rows and columns.
constexpr int STEPS[2][3][2] = {{{0, 0}, {0, 1}, {1, 1}}, {{0, 0}, {1, 1}, {1, 0}}};

// Place in the samples of a corner of facet `number`: two of each cell, row by row.
std::size_t corner_of(const FieldSamples& samples, std::size_t number, int corner) {
  const std::size_t cells = samples.columns - 1, cell = number / 2;
  const int* step = STEPS[number % 2][corner];
  return (cell / cells + step[0]) * samples.columns + cell % cells + step[1];
}

std::vector<Vec3> points_of(const FieldSamples& samples, const GridPose& pose, double resolution,
                            const SupportRecord& support) {
  std::vector<Vec3> points;
  points.reserve(static_cast<std::size_t>(samples.rows) * samples.columns);
  const auto stride = static_cast<double>(support.stride);
  for (int r = 0; r < samples.rows; ++r) {
    for (int c = 0; c < samples.columns; ++c) {
      const GridPoint place{static_cast<double>(support.row) + r * stride, static_cast<double>(support.column) + c * stride};
      points.push_back(pose.point(place, resolution, samples.heights[points.size()]));
    }
  }
  return points;
}

// Vertical velocity of a facet at its first corner [m/s], and its gradient [1/s].
struct Rise {
  double first, x, y;
};

Rise rise_of(const FieldSamples& samples, const Nearest& nearest) {
  const double first = samples.velocities[corner_of(samples, nearest.number, 0)];
  const double p = samples.velocities[corner_of(samples, nearest.number, 1)] - first;
  const double q = samples.velocities[corner_of(samples, nearest.number, 2)] - first;
  const Vec3 u = nearest.triangle.b - nearest.triangle.a, v = nearest.triangle.c - nearest.triangle.a;
  const double area = u.x * v.y - u.y * v.x;
  return {first, (p * v.y - q * u.y) / area, (q * u.x - p * v.x) / area};
}

}  // namespace

void find_foot(const FieldSamples& samples, const GridPose& pose, double resolution, const BodySolid& body,
               SupportRecord& support) {
  const std::vector<Vec3> points = points_of(samples, pose, resolution, support);
  Nearest nearest(body);
  const std::size_t facets = 2 * static_cast<std::size_t>(samples.rows - 1) * (samples.columns - 1);
  for (std::size_t k = 0; k < facets; ++k) {
    const Triangle facet{points[corner_of(samples, k, 0)], points[corner_of(samples, k, 1)],
                         points[corner_of(samples, k, 2)]};
    if (!std::isnan(facet.a.z + facet.b.z + facet.c.z)) nearest.try_one(facet, k);
  }
  support.state = Support::None;
  if (!std::isfinite(nearest.rank)) return;
  support.state = Support::Field;
  const Vec3 normal = nearest.normal(), first = nearest.triangle.a, centre = body.whole.centre;
  const bool is_ball = body.whole.shape->kind == ShapeKind::Ball;
  const Vec3 foot = is_ball ? nearest.gap.nearest : centre - normal * dot(centre - first, normal);
  const Rise rise = rise_of(samples, nearest);
  support.gap = nearest.gap.distance;
  write(foot, support.foot), write(normal, support.normal);
  support.rise = rise.first + rise.x * (foot.x - first.x) + rise.y * (foot.y - first.y);
  // A point (x, y) of ground with angular velocity w rises at w_x y - w_y x.
  write({rise.y, -rise.x, pose.spin}, support.turn);
  const Vec3 slide = pose.slide(foot.x, foot.y);
  support.slide[0] = slide.x, support.slide[1] = slide.y;
}

void find_foot(const std::vector<Vec3>& corners, const BodySolid& body, SupportRecord& support) {
  Nearest nearest(body);
  for (std::size_t k = 0; k + 2 < corners.size(); k += 3)
    nearest.try_one({corners[k], corners[k + 1], corners[k + 2]}, k);
  const bool found = std::isfinite(nearest.rank);
  support.gap = nearest.gap.distance;
  write(found ? nearest.gap.nearest : body.whole.centre, support.foot);
  write(found ? nearest.normal() : Vec3{0.0, 0.0, 1.0}, support.normal);
}

}  // namespace smartmesh
