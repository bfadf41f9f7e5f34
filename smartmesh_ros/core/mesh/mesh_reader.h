// Reader of a moving mesh at one instant: its vertices, and points and rays on it.
#pragma once

#include <vector>

#include "mesh/mesh_surface.h"

namespace smartmesh {

// Position of a vertex [m], and its displacement [m] within a duration.
struct Vertex {
  Vec3 position, displacement;
};

class MeshReader {
 public:
  // Displacements are those within the time `ahead` [s].
  MeshReader(const MeshSurface& mesh, double time, double ahead);

  // Computes all vertices if that pays for `count` points or rays.
  void prepare(std::size_t count);

  Vec3 position(int v) const { return positions_.empty() ? moved(v, motions(v)) : positions_[v]; }
  Vec3 displacement_of(int v) const {
    return displacements_.empty() ? displacement_of(v, motions(v)) : displacements_[v];
  }
  Vertex read(int v) const {
    const Motions m = motions(v);
    return {moved(v, m), displacement_of(v, m)};
  }
  Motion motion(int axis, int v) const {
    if (velocities_.newest == nullptr) return {};
    return velocities_.motion(static_cast<std::size_t>(axis) * mesh_->vertices + v, phase_, mesh_->max_velocity);
  }

  // Returns the highest ground at (x, y) that is not above `z` [m].
  GroundSample below(double x, double y, double z);

  // Returns where a ray along the unit vector `way` meets the mesh first within `range` [m], from either side.
  RayHit first_hit(const Vec3& from, const Vec3& way, double range) const;

  double ahead() const { return ahead_; }

 private:
  struct Motions {
    Motion x, y, z;
  };

  Motions motions(int v) const { return {motion(0, v), motion(1, v), motion(2, v)}; }
  Vec3 moved(int v, const Motions& m) const {
    if (still_) return mesh_->points_[v];
    const Vec3 moved =
        mesh_->points_[v] + Vec3{displacement(m.x, phase_), displacement(m.y, phase_), displacement(m.z, phase_)};
    return blend_.offset == 0.0 ? moved : moved + deviation(v, blend_.offset, blend_.rate);
  }

  Vec3 displacement_of(int v, const Motions& m) const {
    const Vec3 change = {rise_of(m.x, phase_, ahead_), rise_of(m.y, phase_, ahead_), rise_of(m.z, phase_, ahead_)};
    return blend_.offset_change == 0.0 ? change : change + deviation(v, blend_.offset_change, blend_.rate_change);
  }

  // Returns a sum of a vertex' offset and its rate with two weights.
  Vec3 deviation(int v, double of_offset, double of_rate) const {
    const double *offset = mesh_->offsets.data() + v, *rate = mesh_->rates.data() + v;
    const std::ptrdiff_t n = mesh_->vertices;
    return {of_offset * offset[0] + of_rate * rate[0], of_offset * offset[n] + of_rate * rate[n],
            of_offset * offset[2 * n] + of_rate * rate[2 * n]};
  }

  const MeshSurface* mesh_;
  Phase phase_;
  Blend blend_;
  double ahead_, age_, drift_;
  bool still_;
  LastVelocities<double> velocities_;
  std::vector<Vec3> positions_, displacements_;  // of all vertices, or empty
  std::vector<int> found_;
};

}  // namespace smartmesh
