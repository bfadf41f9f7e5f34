// What Python sees of contacts: those of one shape with the ground, without PyBullet.
#include "contact/deck_contacts.h"
#include "python/tables.h"
#include "shape/lower_surface.h"

namespace smartmesh {
namespace {

// Columns of a table of contacts: point, normal, distance, and the names of both features.
constexpr std::size_t COLUMNS = 9;

double checked(double value, const char* name) {
  if (!(value >= 0.0 && value < 1e9))
    throw std::invalid_argument(std::string(name) + " must be at least zero and finite");
  return value;
}

// Returns the rows of a table (count, 3).
const Vec3* vectors_of(const Doubles2& table, std::size_t count, const char* name) {
  check_table(table, count, 3, name);
  for (std::size_t k = 0; k < count; ++k) finite(norm2(rows_of<Vec3>(table)[k]), name);
  return rows_of<Vec3>(table);
}

// How a shape of one part meets the ground of some tiles. `pose` (4, 3): the rows of the rotation, then the position.
// `motion` (2, 3): linear and angular velocity relative to the ground, which is read at `time` [s].
NewTable find_contacts_with(const BodyShape& body, const nb::list& tiles, Doubles2 pose, Doubles2 motion,
                            double duration, double margin, double time) {
  if (body.parts.size() != 1) throw std::invalid_argument("the shape must be of one part");
  const Convex shape = convex_of(body.parts[0]);
  const Vec3 *rows = vectors_of(pose, 4, "a pose"), *velocities = vectors_of(motion, 2, "a motion");
  const Approach approach{velocities[0], velocities[1], rows[3], checked(duration, "the duration"),
                          checked(margin, "the margin")};
  Tiles terrain;
  set_tiles_of(terrain, tiles);
  std::vector<Contact> contacts;
  const Pose at = Pose{{{rows[0], rows[1], rows[2]}}, rows[3]} * pose_of(body.outline);
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
  m.def("find_contacts", &find_contacts_with, "shape"_a, "tiles"_a, "pose"_a.noconvert(), "motion"_a.noconvert(),
        "duration"_a, "margin"_a, "time"_a = 0.0);
}

}  // namespace smartmesh
