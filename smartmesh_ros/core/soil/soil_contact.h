// Contacts of a body with soil: what the soil under it carries at the end of a step, as springs for a solver.
//
// The samples under the body have pressures by their sinkages at the end of the step. Where the body is then follows
// from its inertia and the load that it carried in the last step. Soil is stiff on the way up and soft on the way down:
// a spring with the stiffness of the wrong way would throw the body.
#pragma once

#include <vector>

#include "soil/part_motion.h"
#include "soil/placed_part.h"

namespace smartmesh {

// A step of the world. `time` [s]: at its start; `dt` [s]: its duration; `number` of the step, from 1 on, and of the
// `last` one before it in which the part may have pressed the soil; 0 = any, it slept.
struct SoilStep {
  double time, dt;
  std::int32_t number, last;
};

// What a part of a body carries: `mass` [kg], and the `load`, what acts on it but the soil. `is_set_down`: the soil
// damps it critically, as if a crane lowered it.
struct Carried {
  double mass;
  Vec3 load;
  bool is_set_down = false;
};

// A spring between the soil and a body. `point` on the body [m]; `normal`: unit, into the body. Its force along the
// normal is `force` [N] if the point moves at `speed` [m/s] along it, and falls by `slope` [N s/m] with a higher speed.
// `friction`: the soil's shear strength over the force.
struct SoilSpring {
  Vec3 point, normal;
  double force, speed, slope, friction;
};

// The soil under a part of a body: the deepest `sinkage` [m], `area` [m^2], and force that its pressures carry [N].
struct SoilSums {
  double sinkage = 0.0, area = 0.0, carried = 0.0;
};

// Its memory serves one part after the other.
class SoilUnderBody {
 public:
  // Returns the springs of a part for a step, at most four. They hold until the next call.
  const std::vector<SoilSpring>& find_springs(SoilLattice& soil, const MovingSolid& moving, const Carried& carried,
                                              const ShearedRim& rim, const SoilStep& step);
  // Presses the soil to where the part is at the end of a step.
  SoilSums press(SoilLattice& soil, const MovingSolid& moving, ShearedRim& rim, const SoilStep& step);
  // Makes room for a part that was put into the soil: it has a print there that carries it.
  void make_room(SoilLattice& soil, const MovingSolid& moving, const SoilStep& step);

 private:
  // A sample under the part, or beside its edge. `offset` [m]: of the underside from its middle, in axes of the grid.
  // Heights [m] without the map's z: of the underside `low`, and at the start of the step that of the underside
  // `before` and of the ground `surface`. Where the underside was below the ground it came there sideways, behind an
  // edge that slid. `turns`: above that height the soil gives way no more, but rises as a spring; infinity if its own
  // past says so. `leaves`: the underside rises there.
  struct Under {
    FineSample* sample;
    const LoadedSoil* soil;
    int row, column;
    Vec3 offset, normal, lever;
    double low, before, turns, surface, area;
    bool leaves;
    double pressure = 0.0, total = 0.0, stiffness = 0.0;
    int quarter = 0;

    bool carries() const { return total > 0.0 && area > 0.0; }
    // Returns the height [m] down to which an underside at a height presses the soil. One that leaves presses it no
    // further.
    double pressed_at(double height) const { return std::max(leaves ? surface : -INFINITE, std::min(height, turns)); }
    // Returns how far soil below an underside at a height can rise after it [m].
    double risen_at(double height) const { return std::max(0.0, height - turns); }
  };
  struct Quarter;

  void gather(SoilLattice& soil, const PlacedPart& placed, const MovingSolid& moving, double slip, double deepest,
              const Vec3& to_come, const SoilStep& step);
  void damp_critically(double mass, double dt);
  void load(const Vec3& way);
  Vec3 settle(const Mat3& inertia, const Vec3& free, const Vec3& start, double reach);
  bool find_quarters(const PlacedPart& placed, const ShearedRim& rim, const Solid& then, double dt,
                     Quarter (&quarters)[4]);

  UndersideRow row_, exact_;
  std::vector<LoadedSoil> soils_;
  std::vector<Under> under_;
  PointsInSoil points_;
  std::vector<SoilSpring> springs_;
};

}  // namespace smartmesh
