// What Python sees of tables of bodies: states of other worlds, messages with them, and rays onto bodies.
#include <algorithm>
#include <cmath>
#include <string>

#include "bullet/attached.h"
#include "math/box_tree.h"
#include "python/bindings.h"
#include "shape/solid.h"

namespace smartmesh {

namespace {

// How much a ray may miss a box [m], against rounding.
constexpr double SLACK = 1e-9;

// Returns a state extrapolated by a `duration` [s], which may be negative, at constant velocities.
BodyState extrapolated(const BodyState& state, double duration) {
  BodyState moved = state;
  moved.pose.at = state.pose.at + duration * state.linear;
  const double speed = norm(state.angular);
  if (!(speed > 0.0)) return moved;
  const Vec3 axis = state.angular * (std::sin(0.5 * speed * duration) / speed);
  moved.pose.orientation =
      Quaternion{axis.x, axis.y, axis.z, std::cos(0.5 * speed * duration)} * state.pose.orientation;
  return moved;
}

// Returns the state that is a `share` (0 to 1) of the way from one to a `target`.
BodyState blended(const BodyState& state, const BodyState& target, double share) {
  const auto between = [&](const Vec3& from, const Vec3& to) { return from + share * (to - from); };
  const Quaternion &a = state.pose.orientation, &b = target.pose.orientation;
  // q and -q are the same rotation: take the shorter way.
  const double of_a = 1.0 - share, of_b = dot(a, b) < 0.0 ? -share : share;
  const Quaternion sum{of_a * a.x + of_b * b.x, of_a * a.y + of_b * b.y, of_a * a.z + of_b * b.z,
                       of_a * a.w + of_b * b.w};
  const double length = std::sqrt(dot(sum, sum));
  return {{between(state.pose.at, target.pose.at), {sum.x / length, sum.y / length, sum.z / length, sum.w / length}},
          between(state.linear, target.linear),
          between(state.angular, target.angular)};
}

// Returns states (n, 13) after a `duration` [s].
auto extrapolated_states(Rows<const BodyState> states, double duration) {
  finite(duration, "the duration");
  std::vector<BodyState> moved;
  for (const BodyState& state : states) moved.push_back(extrapolated(state, duration));
  return array_of(std::move(moved));
}

// Returns states (n, 13) a `share` of the way to `targets`.
auto blended_states(Rows<const BodyState> states, Rows<const BodyState> targets, double share) {
  check_counts(states.size(), targets);
  finite(share, "the share");
  std::vector<BodyState> drawn;
  for (std::size_t k = 0; k < states.size(); ++k) drawn.push_back(blended(states[k], targets[k], share));
  return array_of(std::move(drawn));
}

// Remote bodies: `states`, bounding `radii` [m], and `margins` [m] within which they are near.
using Remote = std::tuple<Rows<const BodyState>, Doubles1, Doubles1>;

// Returns which remote bodies, extrapolated by a `duration` [s], are near (n,): with the bounding sphere within the
// margin of that of any own one of the `attached` bodies, or able to come there within a `horizon` [s] at their
// relative speed.
auto near_any(Remote remote, double duration, Rows<const AttachedRow> attached, double horizon) {
  const auto& [states, radii, margins] = remote;
  const std::size_t count = states.size();
  check_counts(count, radii, margins);
  finite(duration, "the duration"), finite(horizon, "the horizon");
  std::vector<AttachedRow> own;
  Bounds bounds;
  double fastest = 0.0, largest = 0.0;
  for (const AttachedRow& row : attached) {
    if (!row.own || std::isnan(row.at.x)) continue;
    own.push_back(row), bounds.add(row.at);
    fastest = std::max(fastest, norm(row.velocity)), largest = std::max(largest, row.radius);
  }
  const Vec3 &low = bounds.low, &high = bounds.high;
  std::vector<char> near(count, false);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 velocity = states[i].linear, p = states[i].pose.at + duration * velocity;
    const double radius = radii[i] + margins[i];
    const double most = radius + largest + (norm(velocity) + fastest) * horizon;
    if (p.x < low.x - most || p.x > high.x + most || p.y < low.y - most || p.y > high.y + most) continue;
    near[i] = std::any_of(own.begin(), own.end(), [&](const AttachedRow& row) {
      const double square = norm2(row.at - p);
      return square < most * most && std::sqrt(square) < radius + row.radius + norm(velocity - row.velocity) * horizon;
    });
  }
  return array_of(std::move(near));
}

// Returns which remote ones (n,) of the `attached` bodies (n, 10) came within a `slack` [m] of the bounding sphere of
// another solid one in the last step of `duration` [s], after which bodies move at their velocities.
auto may_touch(Rows<const AttachedRow> attached, double duration, double slack) {
  finite(duration, "the duration"), finite(slack, "the slack");
  const std::size_t count = attached.size();
  std::vector<Vec3> at(count), ways(count);  // before the step, and in it
  double most = 0.0;                         // largest radius and motion of a solid body [m]
  for (std::size_t j = 0; j < count; ++j) {
    ways[j] = attached[j].velocity * duration, at[j] = attached[j].at - ways[j];
    if (attached[j].solid) most = std::max(most, attached[j].radius + norm(ways[j]));
  }
  std::vector<char> found(count, false);
  for (std::size_t i = 0; i < count; ++i) {
    const double radius = attached[i].radius + slack, farthest = radius + norm(ways[i]) + most;
    for (std::size_t j = 0; attached[i].remote && j < count && !found[i]; ++j) {
      const double square = norm2(at[i] - at[j]);
      if (!(square < farthest * farthest) || !attached[j].solid || i == j) continue;
      const double near = radius + attached[j].radius + norm(ways[i] - ways[j]);
      found[i] = square < near * near;
    }
  }
  return array_of(std::move(found));
}

// Returns which rays, with unit `ways`, pass through one of the boxes (n, 6) within their `ranges` (N,) [m].
auto may_meet(Rows<const Vec3> origins, Rows<const Vec3> ways, Doubles1 ranges, Rows<const Bounds> boxes) {
  check_counts(origins.size(), ways, ranges);
  if (boxes.size() > 1u << 24) throw std::invalid_argument("there are at most 2^24 boxes");
  for (const Bounds& box : boxes)
    for (int axis = 0; axis < 3; ++axis)
      finite(component(box.low, axis), "boxes"), finite(component(box.high, axis), "boxes");
  BoxTree tree;
  tree.build({boxes.begin(), boxes.end()});
  std::vector<char> found;
  for (std::size_t k = 0; k < origins.size(); ++k)
    found.push_back(tree.first_along(origins[k], ways[k], ranges[k], SLACK, [](int) { return 0.0; }).place >= 0);
  return array_of(std::move(found));
}

// Writes the fields of the bodies in a message of body states, which start at a byte, to `rows` (n, width); returns
// their names, each closed by a zero, or None if the message is too short. `content`: its bytes after the header, in
// CDR: texts are aligned to 4 bytes, the fields after them to 8.
nb::object split_bodies(Rows<const std::uint8_t> content, std::size_t at, Array<std::uint8_t, 2> rows) {
  const std::uint8_t* data = content.data();
  const std::size_t size = content.size(), width = rows.shape(1);
  std::string names;
  for (std::size_t i = 0; i < rows.shape(0); ++i) {
    at = (at + 3) / 4 * 4;
    if (at > size || size - at < 4) return nb::none();
    std::size_t length = 0;
    for (std::size_t k = 4; k-- > 0;) length = 256 * length + data[at + k];
    at += 4;
    if (length < 1 || size - at < length) return nb::none();
    names.append(reinterpret_cast<const char*>(data + at), length - 1).push_back('\0');
    at = (at + length + 7) / 8 * 8;
    if (at > size || size - at < width) return nb::none();
    std::copy_n(data + at, width, rows.data() + i * width);
    at += width;
  }
  return nb::bytes(names.data(), names.size());
}

}  // namespace

void add_rows(nb::module_& m) {
  m.def("extrapolated", &extrapolated_states, "states"_a, "duration"_a);
  m.def("blended", &blended_states, "states"_a, "targets"_a, "share"_a);
  m.def("near_any", &near_any, "remote"_a, "duration"_a, "attached"_a, "horizon"_a);
  m.def("may_touch", &may_touch, "attached"_a, "duration"_a, "slack"_a);
  m.def("may_meet", &may_meet, "origins"_a, "ways"_a, "ranges"_a, "boxes"_a);
  m.def("split_bodies", &split_bodies, "content"_a, "at"_a, "rows"_a);
}

}  // namespace smartmesh
