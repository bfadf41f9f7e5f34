// The convex hull of points: triangles of one plane are one face.
#include "shape/convex.h"

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

TEST(HullFaces, OfABoxAreSixQuadrilaterals) {
  std::vector<Vec3> corners;
  for (int k = 0; k < 8; ++k) corners.push_back({k & 1 ? 1.0 : 0.0, k & 2 ? 1.0 : 0.0, k & 4 ? 1.0 : 0.0});
  const auto faces = hull_faces(corners, 1e-9);
  EXPECT_EQ(faces.size(), 6u);
  for (const std::vector<int>& face : faces) EXPECT_EQ(face.size(), 4u);
}

}  // namespace
}  // namespace smartmesh
