#include "map/clock_updates.h"

#include <algorithm>

namespace smartmesh {

namespace {

// Minimum interval for a velocity of its own, as a share of the usual interval. Sooner updates are merged with the
// interval before, because a short interval amplifies jitter and noise.
constexpr double MIN_INTERVAL_SHARE = 0.5;

// Returns the mean of the last intervals [s], zero if there are none. It is the same for bursts as for evenly spaced
// updates; the median would be the interval within a burst.
double usual_interval(const Clock& clock) {
  double total = 0.0;
  for (std::int64_t k = 0; k < clock.count; ++k) total += clock.intervals[k];
  return clock.count > 0 ? total / static_cast<double>(clock.count) : 0.0;
}

// Stores the time `since` the last update [s]. The longest stored interval becomes the expected one.
void note_interval(Clock& clock, double since) {
  clock.count = std::min<std::int64_t>(clock.count + 1, INTERVALS_KEPT);
  std::copy_backward(clock.intervals, clock.intervals + clock.count - 1, clock.intervals + clock.count);
  clock.intervals[0] = since;
  clock.lifetime = std::max(0.0, *std::max_element(clock.intervals, clock.intervals + clock.count));
}

// Merges the interval `since` [s] with the one before, which ended at `before` [s].
VelocityUpdate merge(Clock& clock, double before, double since) {
  note_interval(clock, since);
  const double span = 2.0 * (before - clock.middle) + since;
  clock.middle = clock.time - 0.5 * span;
  return {Estimate::Merged, 1.0 / span, 1.0 - since / span};
}

// Begins a velocity of its own.
VelocityUpdate begin(Clock& clock, double since, bool given, bool recent, double longest) {
  clock.opened = clock.time;
  clock.newest = (clock.newest + 1) % KEPT;
  clock.middle_2 = clock.middle_1, clock.middle_1 = clock.middle;
  clock.middle = given ? clock.time : clock.time - 0.5 * since;
  clock.known = recent ? std::min<std::int64_t>(clock.known + 1, KEPT) : 1;
  if (recent)
    note_interval(clock, since);
  else
    clock.lifetime = longest, clock.count = 0;
  return given ? VelocityUpdate{Estimate::Given, 0.0, 0.0} : VelocityUpdate{Estimate::Difference, 1.0 / since, 0.0};
}

}  // namespace

VelocityUpdate note_update(Clock& clock, double time, bool given, bool whole, const Intervals& intervals) {
  ++clock.updates;
  const double since = time - clock.time, before = clock.time;
  const bool again = since == 0.0 || (0.0 < since && since < intervals.least && !whole);
  const bool recent = !again && 0.0 < since && since <= intervals.most;
  const bool differs = clock.known > 0 && clock.middle < clock.time;
  if (again && !given) {
    if (!differs) return {};
    return {Estimate::Merged, 0.5 / (clock.time - clock.middle), 1.0};
  }
  if (again && clock.known > 0) return {Estimate::Given, 0.0, 1.0};  // of a part: the others keep theirs
  clock.time = time;
  const bool parts = recent && time - clock.opened < intervals.least;
  if (parts && !given && clock.known == 0) return {};
  if (!given && !recent) {
    clock.opened = time, clock.known = 0, clock.lifetime = 0.0, clock.count = 0;
    return {};
  }
  if (recent && !given && differs && (parts || since < MIN_INTERVAL_SHARE * usual_interval(clock)))
    return merge(clock, before, since);
  return begin(clock, since, given, recent, intervals.most);
}

}  // namespace smartmesh
