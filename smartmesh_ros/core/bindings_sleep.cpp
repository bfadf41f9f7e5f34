// What Python sees of sleeping bodies: boxes, islands, what wakes them, and the ground under them.
#include "ground_under.h"
#include "sleepers.h"
#include "tables.h"

namespace smartmesh {
namespace {

// Writes the `boxes` (S, 6) of the bodies in `chosen` slots, and the `anchors` (S, 8) of those that moved farther than a
// `distance` [m]. `shapes` (S, ...): records of SHAPE, as bytes.
void note_motion(Slots chosen, Bytes2 shapes, Doubles2 states, States boxes, States anchors, double time,
                 double distance) {
  const std::size_t count = boxes.shape(0);
  check_table(anchors, count, ANCHOR_COLUMNS, "anchors");
  check_table(boxes, count, BOX_COLUMNS, "boxes"), check_table(states, count, BODY_COLUMNS, "states");
  check_table(shapes, count, sizeof(Shape), "shapes");
  const Shape* records = records_of<Shape>(shapes, "shapes");
  for (std::int64_t slot : slots_below(chosen, count)) {
    const BodyPose& pose = rows_of<BodyState>(states)[slot].pose;
    rows_of<Bounds>(boxes)[slot] = box_of(records[slot], pose);
    Anchor& anchor = rows_of<Anchor>(anchors)[slot];
    if (!(strayed(pose, anchor.pose, records[slot].radius) <= distance)) anchor = {pose, time};
  }
}

// Returns how far a body (13,) has gone from an anchor (7 numbers or more); see strayed.
double strayed_from(Doubles1 state, Doubles1 anchor, double radius) {
  check_list(state, BODY_COLUMNS, "the state");
  check_alignment(anchor.data(), sizeof(double));
  if (anchor.shape(0) < ANCHOR_COLUMNS - 1) throw std::invalid_argument("an anchor has a position and an orientation");
  return strayed(reinterpret_cast<const BodyState*>(state.data())->pose,
                 *reinterpret_cast<const BodyPose*>(anchor.data()), radius);
}

BodyBoxes bodies_of(const Doubles2& boxes, const Doubles1& radii, double near, double share) {
  check_table(boxes, boxes.shape(0), BOX_COLUMNS, "boxes"), check_list(radii, boxes.shape(0), "radii");
  return {rows_of<Bounds>(boxes), radii.data(), finite(near, "near"), finite(share, "the share")};
}

// Returns the island of each body in `chosen` slots (n,); see islands.
nb::ndarray<nb::numpy, std::int64_t, nb::ndim<1>> islands_of(Slots chosen, Slots owners, Doubles2 boxes, Doubles1 radii,
                                                             double near, double share) {
  const BodyBoxes bodies = bodies_of(boxes, radii, near, share);
  check_list(owners, boxes.shape(0), "owners");
  const Slots1 found = islands(slots_below(chosen, boxes.shape(0)), owners.data(), bodies);
  return array_of<std::int64_t, 1>(found, {found.size()});
}

// The sleeping bodies of a world in tables of Python's, which stay alive with it.
struct SleepingBodies {
  Doubles2 boxes;
  Doubles1 radii;
  Sleepers sleepers;

  SleepingBodies(Slots asleep, Doubles2 boxes_s6, Doubles1 radii_s, double near, double share)
      : boxes(boxes_s6), radii(radii_s),
        sleepers(bodies_of(boxes, radii, near, share), slots_below(asleep, boxes.shape(0))) {}

  bool* marks(Array<bool, 1>& found) const {
    check_list(found, boxes.shape(0), "found");
    return found.data();
  }
  // Marks what the body in a slot may touch.
  bool mark_near(std::int64_t slot, Array<bool, 1> found) const {
    if (slot < 0 || slot >= static_cast<std::int64_t>(boxes.shape(0)))
      throw std::invalid_argument("the slot is not in the tables");
    const BodyBoxes& bodies = sleepers.bodies();
    return sleepers.mark_near(bodies.boxes[slot], bodies.near, bodies.radii[slot], marks(found));
  }
  void mark_connected(Array<bool, 1> found) const { sleepers.mark_connected(marks(found)); }

  // `stillness`: as in Stillness.
  bool mark_reached(Slots movers, Doubles2 states, Doubles2 positions, Doubles2 moved, Doubles2 anchors,
                    std::tuple<double, double, double> stillness, double elapsed, Array<bool, 1> found) const {
    const std::size_t count = boxes.shape(0);
    check_table(states, count, BODY_COLUMNS, "states"), check_table(positions, count, 3, "positions");
    check_table(moved, count, 3, "moved"), check_table(anchors, count, ANCHOR_COLUMNS, "anchors");
    const auto [time, after, distance] = stillness;
    return sleepers.mark_reached(
        {slots_below(movers, count), rows_of<BodyState>(states), rows_of<Vec3>(positions), rows_of<Vec3>(moved),
         rows_of<Anchor>(anchors)},
        {time, after, distance}, finite(elapsed, "the time"), marks(found));
  }
};

// Refuses what is not one box and one count for each of some slots.
Slots1 slots_with_boxes(const Slots& chosen, const Doubles2& boxes, const Array<std::int64_t, 1>& counts) {
  check_table(boxes, boxes.shape(0), BOX_COLUMNS, "boxes"), check_list(counts, chosen.shape(0), "counts");
  return slots_below(chosen, boxes.shape(0));
}

// Adds the number of updates under the box of each slot to `counts` (n,); -1 where the ground may move.
void count_updates(const Grid& map, double time, Slots chosen, Doubles2 boxes, Array<std::int64_t, 1> counts) {
  const Slots1 slots = slots_with_boxes(chosen, boxes, counts);
  const GridPose pose = map.grid.pose_at(finite(time, "the time"));
  for (std::size_t k = 0; k < slots.size(); ++k) {
    std::int64_t& count = counts.data()[k];
    const std::int64_t more = updates_under(map.grid, pose, rows_of<Bounds>(boxes)[slots[k]], time);
    count = count < 0 || more < 0 ? -1 : count + more;
  }
}

// Writes the number of samples under the box of each slot to `counts` (n,), and returns their positions (K, 2) [m].
NewTable samples_under(const Grid& map, double time, Slots chosen, Doubles2 boxes, Array<std::int64_t, 1> counts) {
  const Slots1 slots = slots_with_boxes(chosen, boxes, counts);
  const GridPose pose = map.grid.pose_at(finite(time, "the time"));
  std::vector<Region> found;
  std::size_t total = 0;
  for (std::size_t k = 0; k < slots.size(); ++k) {
    found.push_back(samples_around(map.grid, pose, rows_of<Bounds>(boxes)[slots[k]]));
    counts.data()[k] = found.back().size();
    total += static_cast<std::size_t>(found.back().size());
  }
  NewTable positions = new_array<double, 2>({total, 2});
  double* next = positions.data();
  for (const Region& samples : found) write_positions(map.grid, pose, samples, next), next += 2 * samples.size();
  return positions;
}

bool grid_slides(const Grid& map, double time) { return map.grid.pose_at(finite(time, "the time")).slides(); }

}  // namespace

void add_sleep(nb::module_& m) {
  m.def("note_motion", &note_motion, "chosen"_a.noconvert(), "shapes"_a.noconvert(), "states"_a.noconvert(),
        "boxes"_a.noconvert(), "anchors"_a.noconvert(), "time"_a, "distance"_a);
  m.def("strayed", &strayed_from, "state"_a.noconvert(), "anchor"_a.noconvert(), "radius"_a);
  m.def("islands", &islands_of, "chosen"_a.noconvert(), "owners"_a.noconvert(), "boxes"_a.noconvert(),
        "radii"_a.noconvert(), "near"_a, "share"_a);
  nb::class_<SleepingBodies>(m, "Sleepers")
      .def(nb::init<Slots, Doubles2, Doubles1, double, double>(), "asleep"_a.noconvert(), "boxes"_a.noconvert(),
           "radii"_a.noconvert(), "near"_a, "share"_a)
      .def("mark_near", &SleepingBodies::mark_near, "slot"_a, "found"_a.noconvert())
      .def("mark_connected", &SleepingBodies::mark_connected, "found"_a.noconvert())
      .def("mark_reached", &SleepingBodies::mark_reached, "movers"_a.noconvert(), "states"_a.noconvert(),
           "positions"_a.noconvert(), "moved"_a.noconvert(), "anchors"_a.noconvert(), "stillness"_a, "elapsed"_a,
           "found"_a.noconvert());
  m.def("count_updates", &count_updates, "map"_a, "time"_a, "chosen"_a.noconvert(), "boxes"_a.noconvert(),
        "counts"_a.noconvert());
  m.def("samples_under", &samples_under, "map"_a, "time"_a, "chosen"_a.noconvert(), "boxes"_a.noconvert(),
        "counts"_a.noconvert());
  m.def("slides", &grid_slides, "map"_a, "time"_a);
}

}  // namespace smartmesh
