// What the ground of a height map is made of: layers of one number for each sample.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "math/vec3.h"

namespace smartmesh {

// As in terrain/material.py.
enum class Layer : int { Friction, Stiffness, Damping, Restitution, Rolling };
constexpr int LAYERS = 5;

// Material of the ground at a place. `friction` and `restitution` multiply those of a body. `stiffness` [N/m^3],
// `damping` [N s/m^3]: pressure by the depth and by its rate; infinite stiffness = rigid. `rolling`: coefficient of
// rolling resistance.
struct Material {
  double friction = 1.0, stiffness = INFINITE, damping = 0.0, restitution = 1.0, rolling = 0.0;

  bool gives() const { return stiffness < INFINITE; }
  bool operator==(const Material& other) const {
    return friction == other.friction && stiffness == other.stiffness && damping == other.damping &&
           restitution == other.restitution && rolling == other.rolling;
  }
};

// One property of the ground. `samples` (rows, columns), which belong to Python; null: `uniform` everywhere. NaN =
// usual.
struct MaterialLayer {
  const float* samples = nullptr;
  double uniform = NONE;

  bool is_given() const { return samples != nullptr || !std::isnan(uniform); }
};

struct MaterialLayers {
  std::array<MaterialLayer, LAYERS> layers;

  bool is_given() const {
    return std::any_of(layers.begin(), layers.end(), [](const MaterialLayer& layer) { return layer.is_given(); });
  }
  // Returns the material of a sample by its index in the map.
  Material at(std::size_t index) const {
    const auto read = [&](Layer layer, double usual) {
      const MaterialLayer& it = layers[static_cast<int>(layer)];
      const double found = it.samples == nullptr ? it.uniform : static_cast<double>(it.samples[index]);
      return std::isnan(found) ? usual : found;
    };
    const Material usual;
    return {read(Layer::Friction, usual.friction), read(Layer::Stiffness, usual.stiffness),
            read(Layer::Damping, usual.damping), read(Layer::Restitution, usual.restitution),
            read(Layer::Rolling, usual.rolling)};
  }
};

}  // namespace smartmesh
