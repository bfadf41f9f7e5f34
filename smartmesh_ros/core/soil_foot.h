// Bodies that press the soil, and the settings of an update.
#pragma once

#include <cstdint>

#include "soil_layer.h"
#include "soil_shape.h"

namespace smartmesh {

// Vertical force on the soil [N], at a distance (x, y) from the body's position along the world's axes [m]; NaN =
// unknown.
struct FootLoad {
  double force, x, y;
};

// A body that presses the soil, with the layout of FOOT in soil/soil.py.
struct Foot {
  Shape shape;
  BodyState body;
  FootLoad given, load;  // of the last update, and filtered
  // Height of the shape's middle without the map's z [m], at which the soil carries the load, NaN = without load; slope
  // of the pressed plane.
  double seat;
  Slope slope;
  SampleRectangle pressed, seen;  // samples that it pressed last, and those that the next update must look at
  // Results: the deepest sinkage [m]; pressed area [m^2]; force of the soil's pressure [N]; shear force over pressing
  // force; volume displaced in the last update [m^3].
  double sinkage, area, carried, grip, displaced;
};
static_assert(sizeof(Foot) == 376, "the layout of FOOT in soil/soil.py");

// Settings of an update. `number`: of the update. The others follow from SoilConfig in soil/config.py: `drop` [m],
// largest difference of neighbouring samples at the angle of repose; `still`, `farthest` [m], smallest change, and
// largest change of samples that rise or have no load; `deepest` [m], farthest way down; `carried` [m], largest change
// that a velocity carries (others jump).
struct SoilUpdate {
  double dt;
  std::int32_t number;
  double load_time, lean_time, deepest;
  double flow, drop;
  int rim, slides;
  double still, farthest, carried;
};

}  // namespace smartmesh
