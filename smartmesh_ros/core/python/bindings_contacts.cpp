// What Python sees of contacts: those of one shape with the ground, without PyBullet.
#include "contact/deck_contacts.h"
#include "python/tables.h"

namespace smartmesh {
namespace {

// Columns of a table of contacts: point, normal, distance, and the names of both features.
constexpr std::size_t COLUMNS = 9;
// Largest number of a hull's points.
constexpr std::size_t MOST_POINTS = 1u << 16;

double checked(double value, const char* name) {
  if (!(value >= 0.0 && value < 1e9))
    throw std::invalid_argument(std::string(name) + " must be at least zero and finite");
  return value;
}

// Returns a table (count, 3).
std::vector<Vec3> vectors_of(const Doubles2& table, std::size_t count, const char* name) {
  check_table(table, count, 3, name);
  std::vector<Vec3> found;
  for (std::size_t k = 0; k < count; ++k) {
    found.push_back(vector_at(table.data() + 3 * k));
    finite(norm2(found[k]), name);
  }
  return found;
}

Convex hull_of_rows(Doubles2 points, double margin) {
  const std::size_t count = points.shape(0);
  if (count == 0 || count > MOST_POINTS) throw std::invalid_argument("a hull has 1 to 65536 points");
  return hull(vectors_of(points, count, "points"), checked(margin, "the margin"));
}

// How a shape meets the ground of some tiles. `pose` (4, 3): the rows of the rotation, then the position. `motion` (2,
// 3): linear and angular velocity relative to the ground, which is read at `time` [s].
NewTable find_contacts_with(const Convex& shape, const nb::list& tiles, Doubles2 pose, Doubles2 motion, double duration,
                            double margin, double time) {
  const std::vector<Vec3> rows = vectors_of(pose, 4, "a pose"), velocities = vectors_of(motion, 2, "a motion");
  const Approach approach{velocities[0], velocities[1], rows[3], checked(duration, "the duration"),
                          checked(margin, "the margin")};
  Tiles terrain;
  set_tiles_of(terrain, tiles);
  std::vector<Contact> contacts;
  const Pose at{{{rows[0], rows[1], rows[2]}}, rows[3]};
  ContactSearch search;
  Seams seams;
  search.run(shape, at, terrain, finite(time, "the time"), approach, contacts);
  int number = 0;
  for (Deck* deck : terrain.decks()) {
    const NearbyDeck near{number++, {}, 0.0};
    DeckSearch().add(shape, at, *deck, near, time, approach, contacts, seams);
  }
  seams.remove_hidden(search, at.to_world(shape.centre), contacts);
  NewTable found = new_array<double, 2>({contacts.size(), COLUMNS});
  double* next = found.data();
  for (const Contact& c : contacts)
    for (double value : {c.point.x, c.point.y, c.point.z, c.normal.x, c.normal.y, c.normal.z, c.distance,
                         static_cast<double>(c.body_feature), static_cast<double>(c.ground_feature)})
      *next++ = value;
  return found;
}

}  // namespace

void add_contacts(nb::module_& m) {
  nb::class_<Convex>(m, "Shape")
      .def_static(
          "ball", [](double radius) { return ball(checked(radius, "the radius")); }, "radius"_a)
      .def_static(
          "capsule",
          [](double radius, double half) { return capsule(checked(radius, "the radius"), checked(half, "half")); },
          "radius"_a, "half"_a)
      .def_static(
          "cylinder",
          [](double radius, double half) { return cylinder(checked(radius, "the radius"), checked(half, "half")); },
          "radius"_a, "half"_a)
      .def_static(
          "box",
          [](double x, double y, double z) {
            return box({checked(x, "x"), checked(y, "y"), checked(z, "z")});
          },
          "x"_a, "y"_a, "z"_a)
      .def_static("hull", &hull_of_rows, "points"_a.noconvert(), "margin"_a);
  m.def("find_contacts", &find_contacts_with, "shape"_a, "tiles"_a, "pose"_a.noconvert(), "motion"_a.noconvert(),
        "duration"_a, "margin"_a, "time"_a = 0.0);
}

}  // namespace smartmesh
