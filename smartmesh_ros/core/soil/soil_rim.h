// How far the surface of a body has sheared the soil, by Janosi and Hanamoto's law, and how much its rim slips.
#pragma once

#include <vector>

#include "soil/soil_shape.h"

namespace smartmesh {

// A convex part of a body in the world, and the velocities of its middle. `surface` [m/s]: velocity of its surface
// relative to the part, as of a track.
struct MovingSolid {
  Solid solid;
  Vec3 linear, angular;  // [m/s], [rad/s]
  Vec3 surface;
};

// Points of a part in the soil, relative to its middle [m], and normals of its surface there, upwards. `spacing` [m]
// and direction of the columns of the `grid`, with which the sheared soil turns; mean `modulus` of shear [m].
struct PointsInSoil {
  std::vector<Vec3> offsets, normals;
  double spacing = 0.0;
  Vec3 grid;
  double modulus = 0.0;
};

// Shear displacement of the soil along the surface of a part. After Wong and Reece (1967), a place of a wheel's rim
// shears the soil for as long as it takes to pass the contact: so a lying cylinder or capsule has a displacement for
// each place of its rim. Other shapes have one for all their points; that of balls and tracks passes the contact at the
// speed of the surface, and where their motion turns round the soil is soon sheared the other way. A displacement is
// that at the middle of the contact, and an angle by which the surface turned there: away from the middle, that shears
// the soil too.
class ShearedRim {
 public:
  // Returns the displacement at a point, relative to the middle of the part [m]. `away`: from the middle of the contact
  // [m].
  double at(const Solid& solid, const Vec3& offset, double away) const;
  // Share of the rim's speed that is lost, over the way through the contact, 0 to 1; zero for shapes that do not roll.
  double slip() const { return slip_; }

  // Adds the motion of a step of `dt` [s] where the part is in the soil. Elsewhere it will start again.
  void slide(const MovingSolid& moving, const PointsInSoil& points, double dt);
  void reset() { *this = {}; }

  // Adds what it knows to `numbers`, and takes it from there; false if they are none of a rim.
  void write(std::vector<double>& numbers) const;
  bool read(const double* numbers, std::size_t count);

 private:
  // [m], [rad]
  struct Slide {
    double around = 0.0, along = 0.0, turned = 0.0;
  };
  static constexpr int PLACES = 256;

  void slide_all(const MovingSolid& moving, const PointsInSoil& points, double dt);
  void slide_places(const MovingSolid& moving, const PointsInSoil& points, double dt);

  bool lies_ = false;
  double slip_ = 0.0;
  std::vector<Slide> slides_;
};

}  // namespace smartmesh
