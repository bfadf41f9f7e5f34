#include "sleepers.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace smartmesh {

namespace {

}  // namespace

double strayed(const double* state, const double* anchor, double radius) {
  double cosine = 0.0;
  for (int k = 3; k < 7; ++k) cosine += state[k] * anchor[k];
  const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));  // of half the angle between the orientations
  return norm(vector_at(state) - vector_at(anchor)) + 2.0 * sine * radius;
}

void move_anchor(const double* state, double radius, double time, double distance, double* anchor) {
  if (strayed(state, anchor, radius) <= distance) return;
  std::copy_n(state, ANCHOR_COLUMNS - 1, anchor);
  anchor[ANCHOR_COLUMNS - 1] = time;
}

Sleepers::Sleepers(const BodyBoxes& bodies, std::vector<std::int64_t> slots) : bodies_(bodies), order_(std::move(slots)) {
  const auto low_x = [&](std::int64_t slot) {  // unknown boxes come last
    const double x = bodies_.box(slot)[0];
    return std::isnan(x) ? std::numeric_limits<double>::infinity() : x;
  };
  std::stable_sort(order_.begin(), order_.end(), [&](std::int64_t a, std::int64_t b) { return low_x(a) < low_x(b); });
  double extent = 0.0, radius = 0.0;
  for (std::int64_t slot : order_) {
    extent = std::max(extent, bodies_.box(slot)[3] - bodies_.box(slot)[0]);
    radius = std::max(radius, bodies_.radii[slot]);
  }
  widest_ = extent + bodies_.share * radius;
}

bool Sleepers::mark_near(const double* box, double reach, double radius, bool* found) const {
  reach += bodies_.share * radius;
  const double low = box[0] - reach - widest_, high = box[3] + reach + widest_;
  bool any_new = false;
  const auto first = std::partition_point(order_.begin(), order_.end(),
                                          [&](std::int64_t slot) { return bodies_.box(slot)[0] < low; });
  for (auto slot = first; slot != order_.end() && !(bodies_.box(*slot)[0] > high); ++slot)
    if (!found[*slot] && apart(box, bodies_.box(*slot)) <= reach + bodies_.share * bodies_.radii[*slot])
      found[*slot] = any_new = true;
  return any_new;
}

void Sleepers::mark_connected(bool* found) const {
  std::vector<std::int64_t> open;  // marked, but their neighbours are not
  std::vector<bool> listed(order_.size(), false);
  const auto list_marked = [&] {
    for (std::size_t m = 0; m < order_.size(); ++m)
      if (found[order_[m]] && !listed[m]) listed[m] = true, open.push_back(order_[m]);
  };
  for (list_marked(); !open.empty();) {
    const std::int64_t slot = open.back();
    open.pop_back();
    if (mark_near(bodies_.box(slot), bodies_.near, bodies_.radii[slot], found)) list_marked();
  }
}

bool Sleepers::mark_reached(const Movers& movers, const Stillness& stillness, double elapsed, bool* found) const {
  bool any_new = false;
  for (std::int64_t slot : movers.slots) {
    const double *state = movers.states + BODY_COLUMNS * slot, *anchor = movers.anchors + ANCHOR_COLUMNS * slot;
    const Vec3 position = vector_at(movers.positions + 3 * slot), step = vector_at(movers.moved + 3 * slot);
    const double farthest = stillness.distance * stillness.distance;
    if (stillness.time - anchor[ANCHOR_COLUMNS - 1] >= stillness.after && norm2(position - vector_at(anchor)) <= farthest &&
        norm2(step) <= farthest)
      continue;
    const double turned = std::min(norm(vector_at(state + 10)) * elapsed, 2.0) * bodies_.radii[slot];
    const Vec3 went = position - vector_at(state), margin{turned, turned, turned};
    const double* known = bodies_.box(slot);
    const Vec3 low = vector_at(known) + went - margin, high = vector_at(known + 3) + went + margin;
    const double box[BOX_COLUMNS] = {low.x, low.y, low.z, high.x, high.y, high.z};
    any_new |= mark_near(box, bodies_.near + norm(step), bodies_.radii[slot], found);
  }
  return any_new;
}

}  // namespace smartmesh
