// Reader of a moving mesh at one instant: its vertices, and points and rays on it.
#pragma once

#include <vector>

#include "mesh_surface.h"

namespace smartmesh {

// Position of a vertex [m], and its rise [m] within a duration.
struct Vertex {
  Vec3 position, rise;
};

class MeshReader {
 public:
  // Rises are those within the time `ahead` [s].
  MeshReader(const MeshSurface& mesh, double time, double ahead);

  // Computes all vertices if that pays for `count` points or rays.
  void prepare(std::size_t count);

  Vec3 position(int v) const { return positions_.empty() ? moved(v, motions(v)) : positions_[v]; }
  Vec3 rise(int v) const { return rises_.empty() ? risen(motions(v)) : rises_[v]; }
  Vertex read(int v) const {
    const Motions m = motions(v);
    return {moved(v, m), risen(m)};
  }
  Motion motion(int axis, int v) const;

  // Returns the highest ground at (x, y) that is not above `z` [m].
  MeshPoint below(double x, double y, double z);

  // Returns where a ray along the unit vector `way` meets the mesh first within `reach` [m], from either side.
  RayHit first_hit(const Vec3& from, const Vec3& way, double reach) const;

  double ahead() const { return ahead_; }
  // Returns the time since the last update of the mesh [s].
  double age() const { return age_; }

 private:
  struct Motions {
    Motion x, y, z;
  };

  Motions motions(int v) const { return {motion(0, v), motion(1, v), motion(2, v)}; }
  Vec3 moved(int v, const Motions& m) const {
    if (still_) return mesh_->points_[v];
    return mesh_->points_[v] + Vec3{displacement(m.x, phase_), displacement(m.y, phase_), displacement(m.z, phase_)};
  }

  Vec3 risen(const Motions& m) const {
    return {rise_of(m.x, phase_, ahead_), rise_of(m.y, phase_, ahead_), rise_of(m.z, phase_, ahead_)};
  }

  const MeshSurface* mesh_;
  Phase phase_;
  double ahead_, age_, drift_;
  bool still_;
  const double *newest_ = nullptr, *second_ = nullptr, *third_ = nullptr;  // velocities; null: there are none
  std::vector<Vec3> positions_, rises_;  // of all vertices, or empty
  std::vector<int> found_;
};

}  // namespace smartmesh
