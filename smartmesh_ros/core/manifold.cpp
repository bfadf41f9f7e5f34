#include "manifold.h"

#include <algorithm>

namespace smartmesh {

namespace {

// Distance that a new contact must be deeper by to take the place of one that was there [m]. Raising it calms wide
// bodies on rough ground, but lets a new contact penetrate this much.
constexpr double PREFERENCE = 1e-3;
// Share by which a new contact must span a larger area.
constexpr double AREA_PREFERENCE = 1.2;
// Distance within which a contact of other features takes over impulses [m].
constexpr double MATCHING = 0.05;
// Distance below which contacts with one normal are the same [m].
constexpr double SAME_PLACE = 1e-6;

struct Candidate {
  Contact contact;
  double closes;  // distance at the end of the step if nothing held the body back, less the preference [m]
  bool was_there;
};

bool same(const Contact& a, const Contact& b) {
  return norm2(a.point - b.point) < SAME_PLACE * SAME_PLACE && dot(a.normal, b.normal) > 1.0 - 1e-9;
}

void add_distinct(const Contact& contact, std::vector<Contact>& contacts) {
  if (std::none_of(contacts.begin(), contacts.end(), [&](const Contact& other) { return same(contact, other); }))
    contacts.push_back(contact);
}

std::vector<Candidate> candidates_of(const Approach& approach, const std::vector<OldContact>& before,
                                     const std::vector<Contact>& contacts) {
  std::vector<Candidate> found;
  for (const Contact& contact : contacts) {
    const double closing = std::min(0.0, dot(contact.normal, approach.velocity_at(contact)));
    const bool was_there = std::any_of(before.begin(), before.end(), [&](const OldContact& old) {
      return old.body_feature == contact.body_feature && old.ground_feature == contact.ground_feature;
    });
    found.push_back({contact, contact.distance + closing * approach.duration - (was_there ? PREFERENCE : 0.0), was_there});
  }
  return found;
}

// Returns the index of the candidate with the largest value, of those that close first if any has one above zero, else of
// all; `otherwise` if none has.
template <class Value>
int largest(const std::vector<Candidate>& found, double first_close, int otherwise, Value value) {
  for (const double limit : {first_close + PREFERENCE, 1e300}) {
    int best = otherwise;
    double most = 0.0;
    for (std::size_t k = 0; k < found.size(); ++k) {
      if (found[k].closes > limit) continue;
      const double size = value(found[k]) * (found[k].was_there ? AREA_PREFERENCE : 1.0);
      if (size > most) most = size, best = static_cast<int>(k);
    }
    if (best != otherwise) return best;
  }
  return otherwise;
}

}  // namespace

void choose_contacts(const Approach& approach, const std::vector<OldContact>& before, std::vector<Contact>& contacts) {
  if (contacts.size() <= MOST_CONTACTS) {
    std::vector<Contact> distinct;
    for (const Contact& contact : contacts) add_distinct(contact, distinct);
    contacts.swap(distinct);
    return;
  }
  const std::vector<Candidate> found = candidates_of(approach, before, contacts);
  contacts.clear();
  const auto deeper = [](const Candidate& a, const Candidate& b) { return a.closes < b.closes; };
  const int first = static_cast<int>(std::min_element(found.begin(), found.end(), deeper) - found.begin());
  const Vec3 origin = found[first].contact.point, normal = found[first].contact.normal;
  const double least = found[first].closes;
  const int second =
      largest(found, least, first, [&](const Candidate& c) { return norm2(c.contact.point - origin); });
  const Vec3 along = found[second].contact.point - origin;
  const auto side = [&](const Candidate& c) { return dot(cross(along, c.contact.point - origin), normal); };
  const int third = largest(found, least, first, side);
  const int fourth = largest(found, least, first, [&](const Candidate& c) { return -side(c); });
  for (int k : {first, second, third, fourth}) add_distinct(found[k].contact, contacts);
}

const OldContact* matching(const Contact& contact, const std::vector<OldContact>& before) {
  const OldContact* best = nullptr;
  double nearest = MATCHING * MATCHING;
  for (const OldContact& old : before) {
    if (old.body_feature == contact.body_feature && old.ground_feature == contact.ground_feature) return &old;
    const double distance = norm2(old.point - contact.point);
    if (distance < nearest) nearest = distance, best = &old;
  }
  return best;
}

}  // namespace smartmesh
