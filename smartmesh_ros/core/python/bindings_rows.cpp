// What Python sees of tables of bodies: states of other worlds, messages with them, and rays onto bodies.
#include <algorithm>
#include <cmath>
#include <string>

#include "bullet/attached.h"
#include "math/box_tree.h"
#include "python/tables.h"
#include "shape/solid.h"

namespace smartmesh {

namespace {

// How much a ray may miss a box [m], against rounding.
constexpr double SLACK = 1e-9;

// In the order of INVALID in world/state_table.py, which has the words for them.
enum class Fault : int { NotFinite, Orientation, Position, Velocity, Spin, Kind, Size, Centre, Radius, Mass, None };

// Largest coordinate [m], speed [m/s], spin [rad/s] and error of a quaternion's length; least and largest size [m] and
// mass [kg].
struct BodyLimits {
  double farthest, fastest, fastest_spin, slack, least_size, largest_size, least_mass, largest_mass;
};

// Returns true if none of some numbers is beyond a limit, or NaN.
bool all_within(const double* numbers, std::size_t count, double limit) {
  return std::all_of(numbers, numbers + count, [&](double value) { return std::abs(value) <= limit; });
}

bool is_between(double value, double least, double largest) { return value >= least && value <= largest; }

Fault fault_of_state(const double* state, const BodyLimits& limits) {
  if (!std::all_of(state, state + BODY_COLUMNS, [](double value) { return std::isfinite(value); }))
    return Fault::NotFinite;
  const double length =
      std::sqrt(state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6]);
  if (!(std::abs(length - 1.0) <= limits.slack)) return Fault::Orientation;
  if (!all_within(state, 3, limits.farthest)) return Fault::Position;
  if (!all_within(state + 7, 3, limits.fastest)) return Fault::Velocity;
  return all_within(state + 10, 3, limits.fastest_spin) ? Fault::None : Fault::Spin;
}

// Returns the first fault of a body, None if it is possible. `wanted`: number of its dimensions, 0 = there is no such
// kind.
Fault fault_of(const double* state, std::int64_t wanted, const double* dimensions, const double* centre, double radius,
               double mass, const BodyLimits& limits) {
  if (const Fault fault = fault_of_state(state, limits); fault != Fault::None) return fault;
  if (wanted == 0) return Fault::Kind;
  for (int k = 0; k < std::min<std::int64_t>(wanted, 3); ++k)
    if (!is_between(dimensions[k], limits.least_size, limits.largest_size)) return Fault::Size;
  if (!all_within(centre, 3, limits.largest_size)) return Fault::Centre;
  if (!is_between(radius, limits.least_size, limits.largest_size)) return Fault::Radius;
  return is_between(mass, limits.least_mass, limits.largest_mass) ? Fault::None : Fault::Mass;
}

// Number of dimensions of each kind, and the BodyLimits, in their order.
using Limits = std::tuple<Slots, double, double, double, double, double, double, double, double>;

// Returns the row and the Fault of the first impossible body, None if there is none. Bodies: `states` (n, 13), bounding
// `radii` (n,) [m], `kinds` (n,), `dimensions` (n, 3) [m], `centres` (n, 3) relative to the centres of mass [m], and
// `masses` (n,) [kg]; see StateTable in world/state_table.py.
nb::object first_fault(Doubles2 states, Doubles1 radii, Array<const std::uint8_t, 1> kinds, Doubles2 dimensions,
                       Doubles2 centres, Doubles1 masses, Limits limits) {
  const std::size_t count = states.shape(0);
  check_table(states, count, BODY_COLUMNS, "states"), check_table(dimensions, count, 3, "dimensions");
  check_table(centres, count, 3, "centres"), check_list(radii, count, "radii");
  check_list(kinds, count, "kinds"), check_list(masses, count, "masses");
  const auto& [of_kinds, farthest, fastest, spin, slack, least_size, largest_size, least_mass, largest_mass] = limits;
  check_list(of_kinds, of_kinds.shape(0), "dimensions of kinds");
  const BodyLimits most{farthest, fastest, spin, slack, least_size, largest_size, least_mass, largest_mass};
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t kind = kinds.data()[k];
    const std::int64_t wanted = kind < of_kinds.shape(0) ? of_kinds.data()[kind] : 0;
    const Fault fault = fault_of(states.data() + BODY_COLUMNS * k, wanted, dimensions.data() + 3 * k,
                                 centres.data() + 3 * k, radii.data()[k], masses.data()[k], most);
    if (fault != Fault::None) return nb::make_tuple(k, static_cast<int>(fault));
  }
  return nb::none();
}

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
NewTable extrapolated_states(Doubles2 states, double duration) {
  check_table(states, states.shape(0), BODY_COLUMNS, "states");
  finite(duration, "the duration");
  NewTable moved = new_array<double, 2>({states.shape(0), states.shape(1)});
  for (std::size_t k = 0; k < states.shape(0); ++k)
    reinterpret_cast<BodyState*>(moved.data())[k] = extrapolated(rows_of<BodyState>(states)[k], duration);
  return moved;
}

// Returns states (n, 13) a `share` of the way to `targets`.
NewTable blended_states(Doubles2 states, Doubles2 targets, double share) {
  check_table(states, states.shape(0), BODY_COLUMNS, "states");
  check_table(targets, states.shape(0), BODY_COLUMNS, "targets");
  finite(share, "the share");
  NewTable drawn = new_array<double, 2>({states.shape(0), states.shape(1)});
  for (std::size_t k = 0; k < states.shape(0); ++k)
    reinterpret_cast<BodyState*>(drawn.data())[k] =
        blended(rows_of<BodyState>(states)[k], rows_of<BodyState>(targets)[k], share);
  return drawn;
}

// Returns which remote bodies, extrapolated by a `duration` [s], are near (n,): with the bounding sphere within the
// margin of that of any own one of the `attached` bodies, or able to come there within a `horizon` [s] at their
// relative speed. `remote`: `states`, bounding `radii` [m], and `margins` [m].
NewFlags near_any(std::tuple<Doubles2, Doubles1, Doubles1> remote, double duration, Doubles2 attached, double horizon) {
  const auto& [states, radii, margins] = remote;
  const std::size_t count = states.shape(0);
  check_table(states, count, BODY_COLUMNS, "states");
  check_list(radii, count, "radii"), check_list(margins, count, "margins");
  finite(duration, "the duration"), finite(horizon, "the horizon");
  std::vector<AttachedRow> own;
  Bounds bounds;
  double fastest = 0.0, largest = 0.0;
  const AttachedRow* rows = records_of<AttachedRow>(attached, "attached");
  for (const AttachedRow* row = rows; row < rows + attached.shape(0); ++row) {
    if (!row->own || std::isnan(row->at.x)) continue;
    own.push_back(*row), bounds.add(row->at);
    fastest = std::max(fastest, norm(row->velocity)), largest = std::max(largest, row->radius);
  }
  const Vec3 &low = bounds.low, &high = bounds.high;
  NewFlags near = new_array<bool, 1>({count});
  for (std::size_t i = 0; i < count; ++i) {
    const BodyState& state = rows_of<BodyState>(states)[i];
    const Vec3 velocity = state.linear, p = state.pose.at + duration * velocity;
    const double radius = radii.data()[i] + margins.data()[i];
    const double most = radius + largest + (norm(velocity) + fastest) * horizon;
    if (p.x < low.x - most || p.x > high.x + most || p.y < low.y - most || p.y > high.y + most) continue;
    near.data()[i] = std::any_of(own.begin(), own.end(), [&](const AttachedRow& row) {
      const double square = norm2(row.at - p);
      return square < most * most && std::sqrt(square) < radius + row.radius + norm(velocity - row.velocity) * horizon;
    });
  }
  return near;
}

// Returns which remote ones (n,) of the `attached` bodies (n, 10) came within a `slack` [m] of the bounding sphere of
// another solid one in the last step of `duration` [s], after which bodies move at their velocities.
NewFlags may_touch(Doubles2 attached, double duration, double slack) {
  const AttachedRow* rows = records_of<AttachedRow>(attached, "attached");
  finite(duration, "the duration"), finite(slack, "the slack");
  const std::size_t count = attached.shape(0);
  std::vector<Vec3> at(count), ways(count);  // before the step, and in it
  double most = 0.0;                         // largest radius and motion of a solid body [m]
  for (std::size_t j = 0; j < count; ++j) {
    ways[j] = rows[j].velocity * duration, at[j] = rows[j].at - ways[j];
    if (rows[j].solid) most = std::max(most, rows[j].radius + norm(ways[j]));
  }
  NewFlags found = new_array<bool, 1>({count});
  for (std::size_t i = 0; i < count; ++i) {
    const double radius = rows[i].radius + slack, farthest = radius + norm(ways[i]) + most;
    for (std::size_t j = 0; rows[i].remote && j < count && !found.data()[i]; ++j) {
      const double square = norm2(at[i] - at[j]);
      if (!(square < farthest * farthest) || !rows[j].solid || i == j) continue;
      const double near = radius + rows[j].radius + norm(ways[i] - ways[j]);
      found.data()[i] = square < near * near;
    }
  }
  return found;
}

// Returns which rays, with unit `ways`, pass through one of the boxes (n, 6) within their `ranges` (N,) [m].
NewFlags may_meet(Doubles2 origins, Doubles2 ways, Doubles1 ranges, Doubles2 boxes) {
  const std::size_t count = origins.shape(0);
  check_table(origins, count, 3, "origins"), check_table(ways, count, 3, "ways");
  check_table(boxes, boxes.shape(0), 6, "boxes"), check_list(ranges, count, "ranges");
  if (boxes.shape(0) > 1u << 24) throw std::invalid_argument("there are at most 2^24 boxes");
  for (std::size_t k = 0; k < boxes.size(); ++k) finite(boxes.data()[k], "boxes");
  BoxTree tree;
  tree.build({rows_of<Bounds>(boxes), rows_of<Bounds>(boxes) + boxes.shape(0)});
  NewFlags found = new_array<bool, 1>({count});
  for (std::size_t k = 0; k < count; ++k)
    found.data()[k] = tree.first_along(vector_at(origins.data() + 3 * k), vector_at(ways.data() + 3 * k),
                                       ranges.data()[k], SLACK, [](int) { return 0.0; })
                          .place >= 0;
  return found;
}

// Writes the fields of the bodies in a message of body states, which start at a byte, to `rows` (n, width); returns
// their names, each closed by a zero, or None if the message is too short. `content`: its bytes after the header, in
// CDR: texts are aligned to 4 bytes, the fields after them to 8.
nb::object split_bodies(Array<const std::uint8_t, 1> content, std::size_t at, Array<std::uint8_t, 2> rows) {
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
  m.def("first_fault", &first_fault, "states"_a.noconvert(), "radii"_a.noconvert(), "kinds"_a.noconvert(),
        "dimensions"_a.noconvert(), "centres"_a.noconvert(), "masses"_a.noconvert(), "limits"_a.noconvert());
  m.def("extrapolated", &extrapolated_states, "states"_a.noconvert(), "duration"_a);
  m.def("blended", &blended_states, "states"_a.noconvert(), "targets"_a.noconvert(), "share"_a);
  m.def("near_any", &near_any, "remote"_a.noconvert(), "duration"_a, "attached"_a.noconvert(), "horizon"_a);
  m.def("may_touch", &may_touch, "attached"_a.noconvert(), "duration"_a, "slack"_a);
  m.def("may_meet", &may_meet, "origins"_a.noconvert(), "ways"_a.noconvert(), "ranges"_a.noconvert(),
        "boxes"_a.noconvert());
  m.def("split_bodies", &split_bodies, "content"_a.noconvert(), "at"_a, "rows"_a.noconvert());
}

}  // namespace smartmesh
