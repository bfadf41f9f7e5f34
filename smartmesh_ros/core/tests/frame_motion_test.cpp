// Frames that stop between their samples.
#include "ground/frame_motion.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

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

}  // namespace
}  // namespace smartmesh
