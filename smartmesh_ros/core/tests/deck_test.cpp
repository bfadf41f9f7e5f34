// Frames between their samples, and contacts with decks.
#include "contact/deck_contacts.h"

#include <cmath>

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

Quaternion about_x(double angle) { return {std::sin(0.5 * angle), 0.0, 0.0, std::cos(0.5 * angle)}; }

TEST(Frame, ThatStopsDoesNotGoBack) {
  FrameMotion motion;
  for (double t : {0.0, 0.1, 0.2, 0.3, 0.4}) motion.note({t, {std::min(t, 0.3), 0.0, 0.0}, {}, {}});
  EXPECT_NEAR(motion.at(0.45).pose.at.x, 0.3, 1e-12);
}

TEST(Frame, StopsWithoutAJumpOfItsVelocity) {
  FrameMotion motion;
  for (double t : {0.0, 0.1}) motion.note({t, {t, 0.0, 0.0}, {}, {}});
  double last = 1.0, way = motion.at(0.1).pose.at.x;
  for (double t = 0.101; t < 1.0; t += 1e-3) {
    const FrameState now = motion.at(t);
    EXPECT_LE(std::abs(now.velocity.linear.x - last), 4e-3);
    EXPECT_NEAR(now.pose.at.x - way, now.velocity.linear.x * 1e-3, 1e-5);
    last = now.velocity.linear.x, way = now.pose.at.x;
  }
  EXPECT_EQ(last, 0.0);
  EXPECT_FALSE(motion.moves(1.0));
}

// A level map of 11 x 11 samples 0.5 m apart.
struct Level {
  std::vector<float> zeros = std::vector<float>(3 * 121, 0.0f);
  Clock clock{};
  HeightGrid grid;

  Level() {
    grid.heights = grid.velocities = grid.offsets = grid.rates = zeros.data();
    grid.clocks = &clock;
    grid.rows = grid.columns = 11, grid.block_columns = 1, grid.resolution = 0.5, grid.x = grid.y = -2.5;
    grid.mode = Mode::Hold;
  }
};

TEST(Deck, IsTouchedAsGroundInItsFrame) {
  Level level;
  Deck deck;
  deck.tiles.set_all({&level.grid}, {});
  const FrameVelocity velocity{{1.0, 2.0, 3.0}, {0.1, -0.2, 0.3}};
  deck.motion.put({0.0, {4.0, 5.0, 6.0}, about_x(0.5), 1.0, velocity});
  const Pose frame = deck.motion.at(0.0).pose;
  const Pose on_deck{{}, {0.3, 0.4, 0.0999}};
  const Convex shape = box({0.1, 0.1, 0.1});
  const double step = 1.0 / 240.0;
  NearbyDeck near{7, {}, 0.0};
  const Vec3 at = frame.to_world(on_deck.at);
  ASSERT_TRUE(is_near(deck, Bounds{at, at}.grown(0.2), velocity.linear, 0.0, step, near));
  Approach body;
  body.centre = at, body.linear = velocity.linear, body.angular = velocity.angular;
  body.duration = body.ahead = step, body.margin = 1e-3;
  std::vector<Contact> contacts;
  Tiles tiles;
  tiles.set_all({}, {}, std::vector<Deck*>(8, &deck));
  GroundContacts search;
  search.find_on_decks(shape, frame * on_deck, tiles, {near}, 0.0, body);
  search.find(shape, frame * on_deck, tiles, 0.0, body, contacts);
  ASSERT_EQ(contacts.size(), 4u);
  const Pose end = deck.motion.at(step).pose;
  for (const Contact& contact : contacts) {
    EXPECT_EQ(contact.deck, 7);
    EXPECT_NEAR(contact.distance, -1e-4, 1e-12);
    EXPECT_NEAR(norm(contact.normal - frame.rotation * Vec3{0.0, 0.0, 1.0}), 0.0, 1e-12);
    const Vec3 local = frame.to_local(contact.point);
    EXPECT_NEAR(local.z, 0.0, 1e-12);
    EXPECT_NEAR(norm(contact.point + contact.ground.velocity * step - end.to_world(local)), 0.0, 1e-12);
    EXPECT_NEAR(norm(contact.ground.angular - velocity.angular), 0.0, 1e-12);
  }
}

}  // namespace
}  // namespace smartmesh
