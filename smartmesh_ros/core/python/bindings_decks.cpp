// What Python sees of terrains and their decks.
#include "python/bindings.h"
#include "shape/solid.h"

namespace smartmesh {
namespace {

using PoseNumbers = One<BodyPose, 7>;
using VelocityNumbers = One<FrameVelocity, 6>;
constexpr std::size_t MEMORY = sizeof(FrameMemory) / sizeof(double);

// Returns a sample of a pose: position [m] and orientation (x, y, z, w), and of a velocity: linear [m/s] and angular
// [rad/s], none = not told.
FrameSample sample_of(double time, const PoseNumbers& pose, const std::optional<VelocityNumbers>& velocity) {
  FrameSample sample{finite(time, "the time"), pose->at, pose->orientation};
  const double size = dot(sample.orientation, sample.orientation);
  finite(norm2(sample.at), "a position");
  if (!(size > 0.5 && size < 2.0)) throw std::invalid_argument("an orientation must be a unit quaternion (x, y, z, w)");
  if (velocity) sample.is_told = 1.0, sample.velocity = **velocity;
  finite(norm2(sample.velocity.linear) + norm2(sample.velocity.angular), "a velocity");
  return sample;
}

// Tells the motion of a deck's frame a sample.
template <void (FrameMotion::*Way)(const FrameSample&)>
void tell(DeckOfTiles& deck, double time, PoseNumbers pose, std::optional<VelocityNumbers> velocity) {
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
  nb::class_<KeptTiles>(m, "Tiles")
      .def(nb::init<const nb::list&>(), "tiles"_a = nb::list())
      .def("set_tiles", &KeptTiles::set, "tiles"_a);
  nb::class_<DeckOfTiles>(m, "Deck")
      .def(nb::init<>())
      .def("set_tiles", &set_tiles, "tiles"_a)
      .def_prop_rw(
          "thickness", [](const DeckOfTiles& d) { return d.deck.thickness; },
          [](DeckOfTiles& d, double thickness) {
            if (!(thickness > 0.0)) throw std::invalid_argument("a thickness is above zero");
            const StepLock lock;
            d.deck.thickness = thickness;
          })
      .def("move", &tell<&FrameMotion::note>, "time"_a, "pose"_a, "velocity"_a)
      .def("put", &tell<&FrameMotion::put>, "time"_a, "pose"_a, "velocity"_a)
      .def(
          "carry",
          [](DeckOfTiles& d, int body, int link, PoseNumbers place) {
            const FrameSample sample = sample_of(0.0, place, {});
            const StepLock lock;
            if (body < 0 && d.deck.body >= 0) d.deck.motion.stop(d.deck.motion.time());
            d.deck.body = body, d.deck.link = link, d.deck.place = sample;
          },
          "body"_a, "link"_a, "place"_a)
      .def("memory",
           [](const DeckOfTiles& d) {
             const auto* numbers = reinterpret_cast<const double*>(&d.deck.motion.memory());
             return array_of(std::vector<double>(numbers, numbers + MEMORY));
           })
      .def(
          "recall",
          [](DeckOfTiles& d, One<FrameMemory, MEMORY> memory) {
            const StepLock lock;
            if (!d.deck.motion.recall(*memory)) throw std::invalid_argument("the memory is none of a frame");
          },
          "memory"_a)
      .def(
          "shift_time",
          [](DeckOfTiles& d, double by) {
            const StepLock lock;
            d.deck.motion.shift_time(finite(by, "a time"));
          },
          "by"_a)
      .def(
          "moves", [](const DeckOfTiles& d, double time) { return d.deck.motion.moves(time); }, "time"_a)
      // Returns position [m], rotation by rows, linear [m/s] and angular velocity [rad/s] of the frame (6, 3).
      .def(
          "frame",
          [](const DeckOfTiles& d, double time) {
            const FrameState f = d.deck.motion.at(finite(time, "the time"));
            const auto& row = f.pose.rotation.row;
            return array_of(
                std::vector<Vec3>{f.pose.at, row[0], row[1], row[2], f.velocity.linear, f.velocity.angular});
          },
          "time"_a);
}

}  // namespace smartmesh
