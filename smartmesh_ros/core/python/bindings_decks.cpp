// What Python sees of terrains and their decks.
#include "python/tables.h"

namespace smartmesh {
namespace {

// Returns a sample of a pose (7,): position [m] and orientation (x, y, z, w), and of a velocity (6,): linear [m/s] and
// angular [rad/s], none = not told.
FrameSample sample_of(double time, const Doubles1& pose, const std::optional<Doubles1>& velocity) {
  check_list(pose, 7, "a pose");
  FrameSample sample{finite(time, "the time"), vector_at(pose.data()), {}, {}};
  const double* q = pose.data() + 3;
  sample.orientation = {q[0], q[1], q[2], q[3]};
  const double size = dot(sample.orientation, sample.orientation);
  finite(norm2(sample.at), "a position");
  if (!(size > 0.5 && size < 2.0)) throw std::invalid_argument("an orientation must be a unit quaternion (x, y, z, w)");
  if (!velocity) return sample;
  check_list(*velocity, 6, "a velocity");
  sample.velocity = FrameVelocity{vector_at(velocity->data()), vector_at(velocity->data() + 3)};
  finite(norm2(sample.velocity->linear) + norm2(sample.velocity->angular), "a velocity");
  return sample;
}

// Tells the motion of a deck's frame a sample.
template <void (FrameMotion::*Way)(const FrameSample&)>
void tell(DeckOfTiles& deck, double time, Doubles1 pose, std::optional<Doubles1> velocity) {
  const FrameSample sample = sample_of(time, pose, velocity);
  const StepLock lock;
  (deck.deck.motion.*Way)(sample);
}

// Sets the grids and meshes of a deck, which has no decks of its own.
void set_tiles(DeckOfTiles& deck, const nb::list& tiles) {
  for (nb::handle tile : tiles)
    if (nb::isinstance<DeckOfTiles>(tile)) throw std::invalid_argument("a deck has grids and meshes, no decks");
  deck.tiles = set_tiles_of(deck.deck.tiles, tiles);
}

}  // namespace

void add_decks(nb::module_& m) {
  nb::class_<KeptTiles>(m, "Tiles").def(nb::init<>()).def("set_tiles", &KeptTiles::set, "tiles"_a);
  nb::class_<DeckOfTiles>(m, "Deck")
      .def(nb::init<>())
      .def("set_tiles", &set_tiles, "tiles"_a)
      .def_prop_rw(
          "thickness", [](const DeckOfTiles& d) { return d.deck.thickness; },
          [](DeckOfTiles& d, double thickness) {
            if (!(thickness >= 0.0)) throw std::invalid_argument("a thickness is zero or more");
            const StepLock lock;
            d.deck.thickness = thickness;
          })
      .def("move", &tell<&FrameMotion::note>, "time"_a, "pose"_a.noconvert(), "velocity"_a.noconvert().none())
      .def("put", &tell<&FrameMotion::put>, "time"_a, "pose"_a.noconvert(), "velocity"_a.noconvert().none())
      .def(
          "carry",
          [](DeckOfTiles& d, int body, int link, Doubles1 place) {
            const FrameSample sample = sample_of(0.0, place, {});
            const StepLock lock;
            if (body < 0 && d.deck.body >= 0) d.deck.motion.stop(d.deck.motion.time());
            d.deck.body = body, d.deck.link = link, d.deck.place = sample;
          },
          "body"_a, "link"_a, "place"_a.noconvert())
      .def("memory",
           [](const DeckOfTiles& d) {
             auto found = new_array<double, 1>({sizeof(FrameMemory) / sizeof(double)});
             *reinterpret_cast<FrameMemory*>(found.data()) = d.deck.motion.memory();
             return found;
           })
      .def(
          "recall",
          [](DeckOfTiles& d, Doubles1 memory) {
            check_list(memory, sizeof(FrameMemory) / sizeof(double), "the memory");
            const StepLock lock;
            if (!d.deck.motion.recall(*reinterpret_cast<const FrameMemory*>(memory.data())))
              throw std::invalid_argument("the memory is none of a frame");
          },
          "memory"_a.noconvert())
      .def(
          "shift_time",
          [](DeckOfTiles& d, double by) {
            const StepLock lock;
            d.deck.motion.shift_time(finite(by, "a time"));
          },
          "by"_a)
      .def(
          "moves", [](const DeckOfTiles& d, double time) { return d.deck.motion.moves(time); }, "time"_a)
      // Returns position [m], rotation by rows, linear [m/s] and angular velocity [rad/s] of the frame (18,).
      .def(
          "frame",
          [](const DeckOfTiles& d, double time) {
            const FrameState f = d.deck.motion.at(finite(time, "the time"));
            std::vector<double> found;
            for (const Vec3& v : {f.pose.at, f.pose.rotation.row[0], f.pose.rotation.row[1], f.pose.rotation.row[2],
                                  f.velocity.linear, f.velocity.angular})
              found.insert(found.end(), {v.x, v.y, v.z});
            return array_of<double, 1>(found, {18});
          },
          "time"_a);
}

}  // namespace smartmesh
