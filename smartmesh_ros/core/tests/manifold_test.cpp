// The choice of the contacts that a solver gets.
#include "contact/manifold.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

Contact at(double x, double y, double distance, int feature) {
  return {{x, y, 0.0}, {0.0, 0.0, 1.0}, distance, feature, 0};
}

// Contacts of the underside of a flat box of 2 m x 2 m on samples 0.1 m apart, all equally deep.
std::vector<Contact> underside() {
  std::vector<Contact> contacts;
  for (int row = 0; row <= 20; ++row)
    for (int column = 0; column <= 20; ++column)
      contacts.push_back(at(0.1 * column - 1.0, 0.1 * row - 1.0, -1e-5, 21 * row + column));
  return contacts;
}

// Chooses contacts of a box of 2 m x 2 m x 0.2 m at rest on them.
void choose(const std::vector<OldContact>& before, std::vector<Contact>& contacts) {
  Approach rest;
  rest.centre = {0.0, 0.0, 0.1};
  rest.duration = 1.0 / 240.0, rest.margin = 1e-3;
  choose_contacts(box({1.0, 1.0, 0.1}), {}, rest, before, contacts);
}

TEST(Manifold, KeepsItsContactsFromStepToStep) {
  std::vector<Contact> first = underside();
  choose({}, first);
  std::vector<OldContact> before;
  for (const Contact& contact : first)
    before.push_back({contact.body_feature, contact.ground_feature, contact.point, 1.0, {}});
  std::vector<Contact> second = underside();
  for (Contact& contact : second) contact.distance += 1e-4 * std::sin(7.0 * contact.body_feature);
  choose(before, second);
  for (const Contact& contact : second) EXPECT_NE(matching(contact, before, 0.0), nullptr);
}

}  // namespace
}  // namespace smartmesh
