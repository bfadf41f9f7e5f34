#include "ground/deck.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Height from which rays look for ground below all [m], as the largest coordinate of a ray's origin allows.
constexpr double HIGHEST = 1e5;
// Distance above a point of the ground from which a query finds that ground [m].
constexpr double ABOVE = 1e-6;
// Distance from a sleeping body up to which a deck counts as its ground [m].
constexpr double NEAR = 0.01;

}  // namespace

Bounds Deck::local_bounds(const Pose& pose, const Bounds& bounds) {
  return transpose(pose.rotation) * Bounds{bounds.low - pose.at, bounds.high - pose.at};
}

bool Deck::is_above(const Vec3& p, double time) const {
  if (std::isinf(thickness)) return false;
  GroundReader reader = tiles.reader(time, INSTANT);
  return std::isnan(reader.near(p, thickness).height) && !std::isnan(reader.highest(p.x, p.y).height);
}

void Deck::add_ground_under(const Bounds& bounds, double time, GroundUnder& found) {
  const Pose pose = motion.at(time).pose;
  const Bounds local = local_bounds(pose, bounds.grown(NEAR));
  const Vec3 middle = (local.low + local.high) * 0.5;
  if (tiles.near(local, time, 0.0).highest < local.low.z || is_above(middle, time)) return;
  const std::size_t heights = found.heights.size(), vertices = found.vertices.size();
  tiles.add_ground_under(local, time, found);
  if (found.heights.size() == heights && found.vertices.size() == vertices) return;
  std::fill(found.variances.begin() + static_cast<std::ptrdiff_t>(heights), found.variances.end(), -1.0f);
  const double far =
      norm(middle) + norm(local.high - middle);  // no point of the body is farther from the frame's origin
  for (const Vec3& v : {pose.at, pose.rotation.row[0] * far, pose.rotation.row[1] * far, pose.rotation.row[2] * far})
    found.vertices.insert(found.vertices.end(), {v.x, v.y, v.z});
}

DeckReader::DeckReader(const Deck& of, double time)
    : deck(&of), frame(of.motion.at(time)), ground(rays.begin(of.tiles, time)) {}

RayHit DeckReader::first_hit(const Ray& ray) {
  const Pose& pose = frame.pose;
  RayHit hit = rays.first_hit(ground, {pose.to_local(ray.from), transposed(pose.rotation, ray.way), ray.range});
  hit.normal = pose.rotation * hit.normal;
  return hit;
}

GroundSample DeckReader::first_along(const Vec3& p, double up) {
  const Vec3 from{p.x, p.y, std::min(p.z, HIGHEST)};
  const RayHit hit = first_hit({from, {0.0, 0.0, up}, 2.0 * HIGHEST});
  if (!std::isfinite(hit.distance)) return {};
  const Vec3 at{from.x, from.y, from.z + up * hit.distance};
  const Vec3 local = frame.pose.to_local(at);
  const GroundSample here = ground.below({local.x, local.y, local.z + ABOVE});
  const Vec3 own = std::isnan(here.height) ? Vec3{} : frame.pose.rotation * here.velocity;
  return {{at.z, frame.velocity_at(at) + own}, hit.normal, here.age, here.friction, here.on_mesh};
}

GroundSample DeckReader::near(const Vec3& p) {
  const double thickness = deck->thickness;
  const Vec3 local = frame.pose.to_local({p.x, p.y, std::min(p.z, HIGHEST)});
  if (local.z < ground.tiles.at(local.x, local.y, local.z + thickness).facet.height)
    if (const GroundSample over = first_along(p, 1.0); !std::isnan(over.height)) return over;
  const GroundSample here = below(p);
  if (!std::isnan(here.height) || !(local.z < ground.near(local, thickness).height)) return here;
  return below({p.x, p.y, p.z + thickness});
}

}  // namespace smartmesh
