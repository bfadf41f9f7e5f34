// The tree of boxes finds what a search through all boxes finds, also after the boxes moved.
#include "math/box_tree.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

namespace smartmesh {
namespace {

std::vector<Bounds> random_boxes(int count, std::mt19937& random) {
  std::uniform_real_distribution<double> place(-10.0, 10.0), size(0.0, 1.0);
  std::vector<Bounds> boxes;
  for (int k = 0; k < count; ++k) {
    const Vec3 low{place(random), place(random), place(random)};
    boxes.push_back({low, low + Vec3{size(random), size(random), size(random)}});
  }
  return boxes;
}

TEST(BoxTree, FindsWhatASearchThroughAllFinds) {
  std::mt19937 random(1);
  for (int count : {0, 1, 2, 100}) {
    std::vector<Bounds> boxes = random_boxes(count, random);
    BoxTree tree;
    tree.build(boxes);
    for (int trial = 0; trial < 50; ++trial) {
      if (trial == 25) boxes = random_boxes(count, random), tree.refit(boxes);
      const Bounds wanted = random_boxes(1, random)[0].grown(1.0);
      std::vector<int> found, expected;
      tree.find(wanted, found);
      for (int k = 0; k < count; ++k)
        if (boxes[k].meets(wanted)) expected.push_back(k);
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, expected);
    }
  }
}

}  // namespace
}  // namespace smartmesh
