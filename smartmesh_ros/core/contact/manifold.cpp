#include "contact/manifold.h"

#include <algorithm>

namespace smartmesh {

namespace {

// Distance that a new contact must be deeper by to take the place of one that was there, as a share of the shape's
// bounding radius. Raising it calms wide bodies on rough ground, but lets a new contact penetrate this much.
constexpr double PREFERENCE = 1e-3;
// Share by which a new contact must span a larger area.
constexpr double AREA_PREFERENCE = 1.2;
// Distance within which a contact of other features takes over impulses [m].
constexpr double MATCHING = 0.05;
// Distance below which contacts with one normal are the same [m].
constexpr double SAME_PLACE = 1e-6;
// Rounds in which the impulses of held contacts are found.
constexpr int ROUNDS = 8;

struct Candidate {
  const Contact* contact;
  double closes;           // distance at the end of the step if nothing holds the shape, less `preferred` [m]
  double preferred = 0.0;  // of a contact that was there [m]
};

bool same(const Contact& a, const Contact& b) {
  return norm2(a.point - b.point) < SAME_PLACE * SAME_PLACE && dot(a.normal, b.normal) > 1.0 - 1e-9;
}

// Returns the contacts that the step may close, also if the hardest impact of any pushes the shape the other way. Of
// contacts at one place, as those of corners above each other, the deepest counts.
std::vector<Candidate> candidates_of(const Approach& approach, const std::vector<Contact>& contacts) {
  std::vector<Candidate> found;
  double hardest = 0.0;
  for (const Contact& contact : contacts) {
    const double closing = std::max(0.0, -dot(contact.normal, approach.velocity_at(contact))) * approach.duration;
    if (contact.distance <= closing) hardest = std::max(hardest, closing);
    const auto other =
        std::find_if(found.begin(), found.end(), [&](const Candidate& c) { return same(contact, *c.contact); });
    const Candidate it{&contact, contact.distance - closing};
    if (other == found.end())
      found.push_back(it);
    else if (it.closes < other->closes - SAME_PLACE)  // else names would take turns
      *other = it;
  }
  const double limit = approach.margin + IMPACT * hardest;
  found.erase(std::remove_if(found.begin(), found.end(), [&](const Candidate& c) { return c.closes > limit; }),
              found.end());
  return found;
}

void prefer(const std::vector<OldContact>& before, double preference, std::vector<Candidate>& found) {
  for (Candidate& each : found) {
    const auto is_it = [&](const OldContact& old) {
      return old.body_feature == each.contact->body_feature && old.ground_feature == each.contact->ground_feature;
    };
    if (std::any_of(before.begin(), before.end(), is_it)) each.preferred = preference, each.closes -= preference;
  }
}

// A free rigid body of mass 1 that is as full as the box around a shape, held by contacts without friction.
class HeldBody {
 public:
  HeldBody(const Convex& shape, const Pose& pose, const Approach& motion) : rotation_(pose.rotation), motion_(motion) {
    const Vec3 half = (shape.bounds.high - shape.bounds.low) * 0.5;
    const double x = half.x * half.x, y = half.y * half.y, z = half.z * half.z, least = 1e-6 * (x + y + z);
    ease_ = {3.0 / std::max(y + z, least), 3.0 / std::max(z + x, least), 3.0 / std::max(x + y, least)};
  }

  // Returns the distance of a contact at the end of the step [m].
  double distance(const Contact& contact) const {
    return contact.distance + dot(contact.normal, motion_.velocity_at(contact)) * motion_.duration;
  }

  void hold(const Contact& contact) {
    held_.push_back({&contact, 0.0});
    for (int round = 0; round < ROUNDS; ++round)
      for (Held& each : held_) push(each);
  }

 private:
  struct Held {
    const Contact* contact;
    double impulse;
  };

  // Changes an impulse so that its contact gets no deeper, and stays outside the ground if it is there.
  void push(Held& held) {
    const Vec3 &n = held.contact->normal, arm = cross(held.contact->point - motion_.centre, n);
    const Vec3 local = transposed(rotation_, arm);
    const Vec3 spin = rotation_ * Vec3{local.x * ease_.x, local.y * ease_.y, local.z * ease_.z};
    const double over = distance(*held.contact) - std::min(held.contact->distance, 0.0);
    const double impulse = std::max(held.impulse - over / (motion_.duration * (1.0 + dot(arm, spin))), 0.0);
    motion_.linear = motion_.linear + n * (impulse - held.impulse);
    motion_.angular = motion_.angular + spin * (impulse - held.impulse);
    held.impulse = impulse;
  }

  Mat3 rotation_;
  Approach motion_;
  Vec3 ease_;  // inverse moments of inertia about the shape's axes [1 / (kg m^2)]
  std::vector<Held> held_;
};

// Four contacts of a list, chosen one after the other.
class Choice {
 public:
  Choice(const std::vector<Candidate>& found, double preference) : found_(found), preference_(preference) {
    const auto deeper = [](const Candidate& a, const Candidate& b) { return a.closes < b.closes; };
    chosen_.push_back(static_cast<int>(std::min_element(found.begin(), found.end(), deeper) - found.begin()));
  }

  // Returns true if a contact gets deeper than the preference unless the shape is held.
  bool is_hit() const { return first().closes + first().preferred < -preference_; }

  // Adds those that get deepest although those before hold the shape.
  void add_deepest(HeldBody body) {
    while (chosen_.size() < MOST_CONTACTS) {
      body.hold(*found_[chosen_.back()].contact);
      const int next = best(1e300, [&](const Candidate& c) {
        const double distance = body.distance(*c.contact);
        return distance < -preference_ ? c.preferred - distance : 0.0;
      });
      if (next < 0) return;
      chosen_.push_back(next);
    }
  }

  // Adds those that span the largest area, of those that close nearly as much as the first if there are any.
  void add_widest() {
    const Vec3 &origin = first().contact->point, &normal = first().contact->normal;
    add([&](const Candidate& c) { return norm2(c.contact->point - origin); });
    if (chosen_.size() == 1) return;
    const Vec3 along = found_[chosen_[1]].contact->point - origin;
    const auto side = [&](const Candidate& c) { return dot(cross(along, c.contact->point - origin), normal); };
    add(side);
    add([&](const Candidate& c) { return -side(c); });
  }

  std::vector<Contact> chosen() const {
    std::vector<Contact> contacts;
    for (int k : chosen_) contacts.push_back(*found_[k].contact);
    return contacts;
  }

 private:
  const Candidate& first() const { return found_[chosen_[0]]; }

  // Returns the index of the candidate with the largest value above zero that closes by `limit` [m] and is not chosen
  // yet, -1 if there is none.
  template <class Value>
  int best(double limit, Value value) const {
    int index = -1;
    double most = 0.0;
    for (int k = 0; k < static_cast<int>(found_.size()); ++k) {
      if (found_[k].closes > limit || std::find(chosen_.begin(), chosen_.end(), k) != chosen_.end()) continue;
      if (const double own = value(found_[k]); own > most) most = own, index = k;
    }
    return index;
  }

  template <class Value>
  void add(Value value) {
    if (chosen_.size() == MOST_CONTACTS) return;
    const auto steady = [&](const Candidate& c) { return value(c) * (c.preferred > 0.0 ? AREA_PREFERENCE : 1.0); };
    int next = best(first().closes + preference_, steady);
    if (next < 0) next = best(1e300, steady);
    if (next >= 0) chosen_.push_back(next);
  }

  const std::vector<Candidate>& found_;
  double preference_;
  std::vector<int> chosen_;
};

}  // namespace

void choose_contacts(const Convex& shape, const Pose& pose, const Approach& approach,
                     const std::vector<OldContact>& before, std::vector<Contact>& contacts) {
  std::vector<Candidate> found = candidates_of(approach, contacts);
  std::vector<Contact> chosen;
  if (found.size() <= MOST_CONTACTS) {
    for (const Candidate& each : found) chosen.push_back(*each.contact);
  } else {
    const double preference = PREFERENCE * shape.bounding_radius;
    prefer(before, preference, found);
    Choice choice(found, preference);
    if (choice.is_hit()) choice.add_deepest(HeldBody(shape, pose, approach));
    choice.add_widest();
    chosen = choice.chosen();
  }
  contacts.assign(chosen.begin(), chosen.end());
}

const OldContact* matching(const Contact& contact, const std::vector<OldContact>& before, double ago) {
  const Vec3 was = contact.point - contact.ground.velocity * ago;
  const OldContact* best = nullptr;
  double nearest = MATCHING * MATCHING;
  for (const OldContact& old : before) {
    if (old.body_feature == contact.body_feature && old.ground_feature == contact.ground_feature) return &old;
    const double distance = norm2(old.point - was);
    if (distance < nearest) nearest = distance, best = &old;
  }
  return best;
}

}  // namespace smartmesh
