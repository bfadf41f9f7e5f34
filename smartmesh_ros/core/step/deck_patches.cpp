#include "step/deck_patches.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

namespace {

// Revisions of patches on one deck and on another count in numbers that do not meet.
constexpr long OF_DECK = 1L << 40;

// Returns true if a body is below all of a patch by more than a thickness [m]; holes may be above its middle.
bool is_below(const ShownPatch& on, double thickness) {
  const double top = on.body.middle.z + on.body.radius + thickness;
  return std::none_of(on.points.begin(), on.points.end(), [&](const Vec3& p) { return p.z <= top; });
}

}  // namespace

DeckPatches::DeckPatches(const Deck& deck, int number) : deck_(&deck), number_(number) {
  patches_.set_tiles(deck.tiles.maps(), deck.tiles.meshes());
}

void DeckPatches::search(const std::vector<std::int64_t>& slots, const std::vector<ReachingBody>& bodies,
                         std::size_t size, double time) {
  patches_.resize(size), shown_.resize(size);
  for (std::int64_t slot : slots_) shown_[slot].is_shown = false;
  slots_ = slots;
  patches_.search(slots, bodies, time);
}

void DeckPatches::collect(double time) {
  patches_.collect(slots_, time);
  const FrameState frame = deck_->motion.at(time);
  for (std::int64_t slot : slots_) {
    const ShownPatch& on = patches_[slot];
    shown_[slot].is_shown = on.is_shown && !deck_->is_above(on.body.middle, time) && !is_below(on, deck_->thickness);
    if (shown_[slot].is_shown) show(on, frame, shown_[slot]);
  }
}

const ShownPatch& DeckPatches::first_of(std::size_t slot, const ShownPatch& other) const {
  if (slot >= shown_.size() || !shown_[slot].is_shown) return other;
  const bool touches = patches_[slot].is_mesh || patches_[slot].reaches_map();
  return touches || !other.is_shown || shown_[slot].highest > other.highest ? shown_[slot] : other;
}

// Turns a patch into the world, without its holes.
void DeckPatches::show(const ShownPatch& on, const FrameState& frame, ShownPatch& shown) {
  std::vector<Vec3> points;
  std::vector<std::int32_t> place(on.points.size(), -1);
  Vec3 mean;
  shown.highest = -1e300;
  for (std::size_t k = 0; k < on.points.size(); ++k) {
    if (std::isnan(on.points[k].z)) continue;
    place[k] = static_cast<std::int32_t>(points.size());
    points.push_back(frame.pose.to_world(on.points[k]));
    mean = mean + points.back();
    shown.highest = std::max(shown.highest, points.back().z);
  }
  std::vector<std::array<std::int32_t, 3>> triangles = on.triangles;
  for (auto& corners : triangles)
    for (std::int32_t& corner : corners) corner = place[corner];
  mean = mean * (1.0 / points.size());
  const Vec3& middle = *std::min_element(points.begin(), points.end(), [&](const Vec3& a, const Vec3& b) {
    return std::hypot(a.x - mean.x, a.y - mean.y) < std::hypot(b.x - mean.x, b.y - mean.y);
  });
  const Vec3 linear = frame.velocity_at(middle) + frame.pose.rotation * on.linear;
  const Vec3 angular = frame.velocity.angular + frame.pose.rotation * on.angular;
  const bool moves_otherwise = norm2(linear - shown.linear) + norm2(angular - shown.angular) > 0.0;
  const bool is_new = moves_otherwise || !are_same(points, shown.points) || triangles != shown.triangles;
  if (is_new) shown.points_revision = std::max(shown.points_revision, OF_DECK * (number_ + 1)) + 1;
  if (is_new || on.near != shown.near) shown.near_revision = std::max(shown.near_revision, OF_DECK * (number_ + 1)) + 1;
  shown.linear = linear, shown.angular = angular;
  shown.points.swap(points), shown.triangles.swap(triangles);
  shown.near = on.near;
  shown.is_mesh = true, shown.of_mesh = on.of_mesh, shown.deck = number_;
  shown.square.stride = on.square.stride;
  shown.tile = on.tile, shown.row = on.row, shown.column = on.column;
}

}  // namespace smartmesh
