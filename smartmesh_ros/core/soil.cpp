#include "soil.h"

#include "soil_flowing.h"

namespace smartmesh {

SoilChanges Soil::update(const HeightGrid& grid, double time, const SoilUpdate& update, Foot* feet, std::size_t count) {
  SoilGround ground(grid, layer_, time);
  Foot* const end = feet + count;
  for (Foot* foot = feet; foot != end; ++foot) press(ground, *foot, update, scratch_);
  for (Foot* foot = feet; foot != end; ++foot) recover(ground, foot->seen, update.number);
  const int margin = (update.flow > 0.0 ? update.rim : 0) + update.slides;
  for (Foot* foot = feet; foot != end; ++foot) {
    if (update.flow > 0.0 && foot->displaced > 0.0) move_to_rim(ground, *foot, update);
    slide_down(ground, foot->pressed.grown(margin, ground.rows, ground.columns), update);
  }
  for (Foot* foot = feet; foot != end; ++foot) {
    const SampleRectangle flows = foot->pressed.grown(margin, ground.rows, ground.columns);
    foot->seen = flows.with(blocks_.note(ground, flows.with(foot->seen), update));
  }
  return blocks_.list(ground, update);
}

}  // namespace smartmesh
