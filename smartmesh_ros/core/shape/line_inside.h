// The part of a line that is inside a shape.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "math/vec3.h"

namespace smartmesh {

constexpr double FAR_ALONG = std::numeric_limits<double>::infinity();

// The part of a line p + t u that is inside a shape: from `first` to `last`, nowhere if these cross.
struct LineInside {
  Vec3 p, u;
  double first = -FAR_ALONG, last = FAR_ALONG;

  bool is_somewhere() const { return first <= last && last > -FAR_ALONG; }
  void clip(const Vec3& normal, double offset) {
    const double start = dot(normal, p) - offset, change = dot(normal, u);
    if (change < 0.0)
      first = std::max(first, -start / change);
    else if (change > 0.0)
      last = std::min(last, -start / change);
    else if (start > 0.0)
      last = -FAR_ALONG;
  }
  // Cuts by a ball around `centre`; with `level` by the cylinder about z through it.
  void cut(const Vec3& centre, double radius, bool level) {
    Vec3 w = p - centre, v = u;
    if (level) w.z = v.z = 0.0;
    const double vv = norm2(v), vw = dot(v, w), outside = norm2(w) - radius * radius, root = vw * vw - vv * outside;
    if (vv == 0.0 ? outside > 0.0 : root < 0.0) {
      last = -FAR_ALONG;
    } else if (vv > 0.0) {
      first = std::max(first, (-vw - std::sqrt(root)) / vv), last = std::min(last, (-vw + std::sqrt(root)) / vv);
    }
  }
};

}  // namespace smartmesh
