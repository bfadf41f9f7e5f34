// The convex hull of points: each face is a supporting plane, and the faces close the surface.
#include "shape/hull_faces.h"

#include <map>
#include <random>
#include <utility>

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

std::vector<Vec3> random_points(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> number;
  std::vector<Vec3> points;
  for (int k = 0; k < count; ++k) points.push_back({number(random), number(random), number(random)});
  return points;
}

TEST(HullFaces, HaveAllPointsBehindThemAndMeetInPairs) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const std::vector<Vec3> points = random_points(40, seed);
    std::map<std::pair<int, int>, int> directed;
    for (const std::vector<int>& face : hull_faces(points, 1e-9)) {
      ASSERT_GE(face.size(), 3u);
      const Vec3 normal = unit(cross(points[face[1]] - points[face[0]], points[face[2]] - points[face[0]]));
      for (const Vec3& p : points) EXPECT_LE(dot(normal, p - points[face[0]]), 1e-9);
      for (std::size_t k = 0; k < face.size(); ++k) ++directed[{face[k], face[(k + 1) % face.size()]}];
    }
    for (const auto& [edge, count] : directed) {
      EXPECT_EQ(count, 1);
      EXPECT_EQ(directed.count({edge.second, edge.first}), 1u);
    }
  }
}

TEST(HullFaces, OfABoxAreSixQuadrilaterals) {
  std::vector<Vec3> corners;
  for (int k = 0; k < 8; ++k) corners.push_back({k & 1 ? 1.0 : 0.0, k & 2 ? 1.0 : 0.0, k & 4 ? 1.0 : 0.0});
  const auto faces = hull_faces(corners, 1e-9);
  EXPECT_EQ(faces.size(), 6u);
  for (const std::vector<int>& face : faces) EXPECT_EQ(face.size(), 4u);
}

TEST(HullFaces, OfFlatPointsAreTwoAndOfALineNone) {
  EXPECT_EQ(hull_faces({{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}, 1e-9).size(), 2u);
  EXPECT_TRUE(hull_faces({{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, 1e-9).empty());
}

}  // namespace
}  // namespace smartmesh
