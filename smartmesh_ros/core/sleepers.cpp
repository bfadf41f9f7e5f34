#include "sleepers.h"

#include <algorithm>
#include <cmath>

namespace smartmesh {

double strayed(const BodyPose& pose, const BodyPose& anchor, double radius) {
  const double cosine = dot(pose.turn, anchor.turn);
  const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 0.0));  // of half the angle between the orientations
  return norm(pose.at - anchor.at) + 2.0 * sine * radius;
}

Sleepers::Sleepers(const BodyBoxes& bodies, std::vector<std::int64_t> slots) : bodies_(bodies), order_(std::move(slots)) {
  bodies_.sort(order_, [](std::int64_t slot) { return slot; });
  double extent = 0.0, radius = 0.0;
  for (std::int64_t slot : order_) {
    extent = std::max(extent, bodies_.boxes[slot].high.x - bodies_.boxes[slot].low.x);
    radius = std::max(radius, bodies_.radii[slot]);
  }
  widest_ = extent + bodies_.share * radius;
}

bool Sleepers::mark_near(const Bounds& box, double reach, double radius, bool* found) const {
  reach += bodies_.share * radius;
  const double low = box.low.x - reach - widest_, high = box.high.x + reach + widest_;
  bool any_new = false;
  const auto first = std::partition_point(order_.begin(), order_.end(),
                                          [&](std::int64_t slot) { return bodies_.boxes[slot].low.x < low; });
  for (auto slot = first; slot != order_.end() && !(bodies_.boxes[*slot].low.x > high); ++slot)
    if (!found[*slot] && box.apart_from(bodies_.boxes[*slot]) <= reach + bodies_.share * bodies_.radii[*slot])
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
    if (mark_near(bodies_.boxes[slot], bodies_.near, bodies_.radii[slot], found)) list_marked();
  }
}

bool Sleepers::mark_reached(const Movers& movers, const Stillness& stillness, double elapsed, bool* found) const {
  bool any_new = false;
  for (std::int64_t slot : movers.slots) {
    const BodyState& state = movers.states[slot];
    const Anchor& anchor = movers.anchors[slot];
    const Vec3 &position = movers.positions[slot], &step = movers.moved[slot];
    const double farthest = stillness.distance * stillness.distance;
    if (stillness.time - anchor.time >= stillness.after && norm2(position - anchor.pose.at) <= farthest &&
        norm2(step) <= farthest)
      continue;
    const double turned = std::min(norm(state.angular) * elapsed, 2.0) * bodies_.radii[slot];
    const Vec3 went = position - state.pose.at;
    const Bounds& known = bodies_.boxes[slot];
    const Bounds box = Bounds{known.low + went, known.high + went}.grown(turned);
    any_new |= mark_near(box, bodies_.near + norm(step), bodies_.radii[slot], found);
  }
  return any_new;
}

}  // namespace smartmesh
