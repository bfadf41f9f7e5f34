// What Python sees of tables of bodies: states of other worlds, messages with them, and rays onto bodies.
#include "math/box_tree.h"
#include "python/tables.h"
#include "step/body_faults.h"
#include "step/body_message.h"
#include "step/body_states.h"

namespace smartmesh {

namespace {

// How much a ray may miss a box [m], against rounding.
constexpr double SLACK = 1e-9;

// Number of dimensions of each kind, and the other BodyLimits, in their order.
using Limits = std::tuple<Slots, double, double, double, double, double, double, double, double>;

// Returns the row and the Fault of the first impossible body, None if there is none.
nb::object first_fault(Doubles2 states, Doubles1 radii, Array<const std::uint8_t, 1> kinds, Doubles2 dimensions,
                       Doubles2 centres, Doubles1 masses, Limits limits) {
  const std::size_t count = states.shape(0);
  check_table(states, count, BODY_COLUMNS, "states"), check_table(dimensions, count, 3, "dimensions");
  check_table(centres, count, 3, "centres"), check_list(radii, count, "radii");
  check_list(kinds, count, "kinds"), check_list(masses, count, "masses");
  const auto& [of_kinds, farthest, fastest, spin, slack, least_size, largest_size, least_mass, largest_mass] = limits;
  check_list(of_kinds, of_kinds.shape(0), "dimensions of kinds");
  const BodyLimits most{farthest,   fastest,      spin,
                        slack,      least_size,   largest_size,
                        least_mass, largest_mass, {of_kinds.data(), of_kinds.data() + of_kinds.shape(0)}};
  const DescribedBodies bodies{states.data(), radii.data(), dimensions.data(), centres.data(), masses.data(),
                               kinds.data(),  count};
  for (std::size_t k = 0; k < count; ++k)
    if (const Fault fault = fault_of(bodies, k, most); fault != Fault::None)
      return nb::make_tuple(k, static_cast<int>(fault));
  return nb::none();
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

// Remote bodies as `states`, `radii` and `margins`, and attached ones as `positions`, `velocities`, `radii` and `own`.
using Remote = std::tuple<Doubles2, Doubles1, Doubles1>;
using Attached = std::tuple<Doubles2, Doubles2, Doubles1, Flags>;

// Returns which remote bodies are near; see find_near.
NewFlags near_any(Remote remote, double duration, Attached attached, double horizon) {
  const auto& [states, radii, margins] = remote;
  const auto& [positions, velocities, own_radii, own] = attached;
  const std::size_t count = states.shape(0), bodies = positions.shape(0);
  check_table(states, count, BODY_COLUMNS, "states");
  check_list(radii, count, "radii"), check_list(margins, count, "margins");
  check_table(positions, bodies, 3, "positions"), check_table(velocities, bodies, 3, "velocities");
  check_list(own_radii, bodies, "radii"), check_list(own, bodies, "own");
  finite(duration, "the duration"), finite(horizon, "the horizon");
  NewFlags near = new_array<bool, 1>({count});
  find_near({rows_of<BodyState>(states), radii.data(), margins.data(), count}, duration,
            {rows_of<Vec3>(positions), rows_of<Vec3>(velocities), own_radii.data(), own.data(), bodies}, horizon,
            near.data());
  return near;
}

// Returns which `guests` came near another body in the last step; see find_touching.
NewFlags may_touch(Doubles2 positions, Doubles2 moved, Doubles1 radii, Flags guests, Flags solid, double slack) {
  const std::size_t count = positions.shape(0);
  check_table(positions, count, 3, "positions"), check_table(moved, count, 3, "moved");
  check_list(radii, count, "radii"), check_list(guests, count, "guests"), check_list(solid, count, "solid");
  NewFlags found = new_array<bool, 1>({count});
  find_touching({rows_of<Vec3>(positions), rows_of<Vec3>(moved), radii.data(), guests.data(), solid.data(), count},
                finite(slack, "the slack"), found.data());
  return found;
}

// The box itself is what a ray is checked against.
struct WholeBox final : RayTarget {
  double distance(int) const override { return 0.0; }
};

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
                                       ranges.data()[k], SLACK, WholeBox{})
                          .place >= 0;
  return found;
}

// Writes the fields of the bodies in a message to `rows` (n, width); returns their names, each closed by a zero, or
// None if the message is too short.
nb::object split(Array<const std::uint8_t, 1> content, std::size_t at, Array<std::uint8_t, 2> rows) {
  std::string names;
  if (!split_bodies({content.data(), content.size()}, at, rows.shape(0), rows.shape(1), rows.data(), names))
    return nb::none();
  return nb::bytes(names.data(), names.size());
}

}  // namespace

void add_rows(nb::module_& m) {
  m.def("first_fault", &first_fault, "states"_a.noconvert(), "radii"_a.noconvert(), "kinds"_a.noconvert(),
        "dimensions"_a.noconvert(), "centres"_a.noconvert(), "masses"_a.noconvert(), "limits"_a.noconvert());
  m.def("extrapolated", &extrapolated_states, "states"_a.noconvert(), "duration"_a);
  m.def("blended", &blended_states, "states"_a.noconvert(), "targets"_a.noconvert(), "share"_a);
  m.def("near_any", &near_any, "remote"_a.noconvert(), "duration"_a, "attached"_a.noconvert(), "horizon"_a);
  m.def("may_touch", &may_touch, "positions"_a.noconvert(), "moved"_a.noconvert(), "radii"_a.noconvert(),
        "guests"_a.noconvert(), "solid"_a.noconvert(), "slack"_a);
  m.def("may_meet", &may_meet, "origins"_a.noconvert(), "ways"_a.noconvert(), "ranges"_a.noconvert(),
        "boxes"_a.noconvert());
  m.def("split_bodies", &split, "content"_a.noconvert(), "at"_a, "rows"_a.noconvert());
}

}  // namespace smartmesh
